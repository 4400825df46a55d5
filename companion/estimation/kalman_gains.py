"""filterpy's Kalman filter of one axis: what a step does to the covariance, and the gain that it gives.

Neither depends on what is measured, so they recur: a sender that keeps its pace settles on one gain within a
few seconds, and one that loses messages now and then passes through the same few again. They are kept.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from companion.values.horizon import Array

Square = tuple[float, float, float, float]
"""A matrix (2, 2), row by row."""


class Noise(NamedTuple):
    """Standard deviations of a measured position (m) and velocity (m/s), and of the acceleration (m/s²)."""

    position: float
    velocity: float
    acceleration: float


class Gain(NamedTuple):
    """``S``: covariance of the innovation, its upper triangle; ``K``: the gain; ``P``: the covariance
    after."""

    S: tuple[float, float, float]
    K: Square
    P: Square


@lru_cache(maxsize=4096)
def gain(noise: Noise, P: Square, elapsed: int) -> Gain:
    """From covariance ``P``, ``elapsed`` µs later, when position and velocity are measured."""
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
    """F and Q (2, 2) of ``elapsed`` µs of white acceleration with the spectral density σ²·(1 s)."""
    dt = elapsed * 1e-6
    q = sigma**2 * dt
    return (
        np.array([[1.0, dt], [0.0, 1.0]]),
        np.array([[q * dt * dt / 3.0, q * dt / 2.0], [q * dt / 2.0, q]]),
    )


@lru_cache(maxsize=64)
def prepared(noise: Noise) -> Any:
    """The filter. Whoever is to be timely asks for it beforehand: the first one loads filterpy."""
    # That brings scipy.stats along, which takes longer than all else of a companion together.
    from filterpy.kalman import KalmanFilter

    kalman = KalmanFilter(dim_x=2, dim_z=2)
    kalman.x = np.zeros(2)
    kalman.H = np.eye(2)
    kalman.R = np.diag([noise.position**2, noise.velocity**2])
    kalman.inv = _inverse
    return kalman


def _inverse(S: Array) -> Array:
    """Of a (2, 2) in closed form: numpy's is made for larger ones."""
    (a, b), (c, d) = S.tolist()
    scale = 1.0 / (a * d - b * c)
    return np.array([[d * scale, -b * scale], [-c * scale, a * scale]])


def _row_by_row(matrix: Array) -> Square:
    (a, b), (c, d) = matrix.tolist()
    return a, b, c, d
