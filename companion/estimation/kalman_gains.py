"""Kalman filter of one axis: covariance after a step, and gain.

Both depend on the noise and the intervals, not on the measured values. They converge within a few seconds for
a sender with a constant rate; after a lost message the same few values occur again. Therefore they are
cached.

The filter is written here because filterpy imports scipy.stats, which takes more time and memory than all
other imports of a companion; the tests compare both.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from companion.values.horizon import Array

Square = tuple[float, float, float, float]
"""A matrix (2, 2), row by row."""
_IDENTITY: Array = np.eye(2)


class Noise(NamedTuple):
    """Standard deviations of measured position (m) and velocity (m/s), and of the acceleration (m/s²)."""

    position: float
    velocity: float
    acceleration: float


class Gain(NamedTuple):
    """Innovation covariance, gain and posterior covariance.

    ``S``: upper triangle of the covariance of the innovation; ``K``: the gain; ``P``: the covariance after
    the update.
    """

    S: tuple[float, float, float]
    K: Square
    P: Square


@lru_cache(maxsize=4096)
def gain(noise: Noise, P: Square, elapsed: int) -> Gain:
    """Compute the gain for a position and velocity measured ``elapsed`` µs after the covariance was ``P``.

    Prediction P = F P Fᵀ + Q; with H = I innovation S = P + R, gain K = P S⁻¹, and Joseph's form of the
    update, P = (I − K) P (I − K)ᵀ + K R Kᵀ. filterpy computes the same bits.
    """
    prior = np.array(P).reshape(2, 2)
    if elapsed > 0:
        F, Q = model(elapsed, noise.acceleration)
        prior = np.dot(np.dot(F, prior), F.T) + Q
    R = np.diag([noise.position**2, noise.velocity**2])
    S = prior + R
    K = np.dot(prior, _inverse(S))
    kept = _IDENTITY - K
    posterior = np.dot(np.dot(kept, prior), kept.T) + np.dot(np.dot(K, R), K.T)
    (s, t), (_, u) = S.tolist()
    return Gain((s, t, u), _row_by_row(K), _row_by_row(posterior))


@lru_cache(maxsize=1024)
def model(elapsed: int, sigma: float) -> tuple[Array, Array]:
    """Return F and Q (2, 2) for ``elapsed`` µs of white acceleration of spectral density σ²·(1 s)."""
    dt = elapsed * 1e-6
    q = sigma**2 * dt
    return (
        np.array([[1.0, dt], [0.0, 1.0]]),
        np.array([[q * dt * dt / 3.0, q * dt / 2.0], [q * dt / 2.0, q]]),
    )


def _inverse(S: Array) -> Array:
    """Invert a (2, 2) matrix in closed form, which is faster than numpy's general inverse."""
    (a, b), (c, d) = S.tolist()
    scale = 1.0 / (a * d - b * c)
    return np.array([[d * scale, -b * scale], [-c * scale, a * scale]])


def _row_by_row(matrix: Array) -> Square:
    (a, b), (c, d) = matrix.tolist()
    return a, b, c, d
