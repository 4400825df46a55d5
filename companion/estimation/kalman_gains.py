"""filterpy's Kalman filter of one axis: covariance after a step, and gain.

Both depend on the noise and the intervals, not on the measured values. They converge within a few seconds for
a sender with a constant rate; after a lost message the same few values occur again. Therefore they are
cached.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from companion.values.horizon import Array

Square = tuple[float, float, float, float]
"""A matrix (2, 2), row by row."""


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
    """Compute the gain for a position and velocity measured ``elapsed`` µs after the covariance was ``P``."""
    kalman = prepared(noise)
    kalman.P = np.array(P).reshape(2, 2)
    if elapsed > 0:
        F, Q = model(elapsed, noise.acceleration)
        kalman.predict(F=F, Q=Q)
    kalman.update(np.zeros(2))
    (s, t), (_, u) = kalman.S.tolist()
    return Gain((s, t, u), _row_by_row(kalman.K), _row_by_row(kalman.P))


@lru_cache(maxsize=1024)
def model(elapsed: int, sigma: float) -> tuple[Array, Array]:
    """Return F and Q (2, 2) for ``elapsed`` µs of white acceleration of spectral density σ²·(1 s)."""
    dt = elapsed * 1e-6
    q = sigma**2 * dt
    return (
        np.array([[1.0, dt], [0.0, 1.0]]),
        np.array([[q * dt * dt / 3.0, q * dt / 2.0], [q * dt / 2.0, q]]),
    )


@lru_cache(maxsize=64)
def prepared(noise: Noise) -> Any:
    """Return the configured filter.

    It is shared by all callers with the same ``noise``. The first call loads filterpy, which takes time:
    call this before time-critical work begins.
    """
    # filterpy also imports scipy.stats, which takes longer than the rest of a companion's start.
    from filterpy.kalman import KalmanFilter

    kalman = KalmanFilter(dim_x=2, dim_z=2)
    kalman.x = np.zeros(2)
    kalman.H = np.eye(2)
    kalman.R = np.diag([noise.position**2, noise.velocity**2])
    kalman.inv = _inverse
    return kalman


def _inverse(S: Array) -> Array:
    """Invert a (2, 2) matrix in closed form, which is faster than numpy's general inverse."""
    (a, b), (c, d) = S.tolist()
    scale = 1.0 / (a * d - b * c)
    return np.array([[d * scale, -b * scale], [-c * scale, a * scale]])


def _row_by_row(matrix: Array) -> Square:
    (a, b), (c, d) = matrix.tolist()
    return a, b, c, d
