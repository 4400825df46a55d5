"""Motion of the fusion filter's states from one detection to the next, as parts of its kernels.

The target's acceleration is exponentially correlated (R. A. Singer, Estimating optimal tracking filter
performance for manned maneuvering targets, IEEE Trans. AES-6(4), 1970). Its states are position, velocity and
acceleration, in this order. Each error of a vehicle is a first-order Gauss–Markov process.
"""

from __future__ import annotations

from math import exp

from companion.values.compiled import part
from companion.values.horizon import Array

WHITE_SHARE = 0.02
"""Of the target's acceleration, the part that is white: a share of the spectral density at 0 Hz.

With it the velocity may change at once, as that of a recorded target does.
"""
_SERIES = 0.05
"""Below this time in time constants covariances are a series, because the closed form cancels."""


@part
def motion(dt: float, rate: float, F: Array, Q: Array) -> None:
    """Write the motion of one axis in ``dt`` (s), for an acceleration of variance 1 that decays at ``rate``.

    ``F`` (4,): what velocity and acceleration add to the position, the acceleration to the velocity, and what
    is left of the acceleration. ``Q`` (6,): covariance of position, velocity and acceleration, upper triangle
    by rows, with the white part.
    """
    x = rate * dt
    e = exp(-x)
    F[0], F[3] = dt, e
    if x < _SERIES:
        s = 2.0 * x
        F[1] = dt * dt * (0.5 - x / 6.0 + x * x / 24.0)
        F[2] = dt * (1.0 - x / 2.0 + x * x / 6.0)
        Q[0] = s * dt**4 * (1.0 / 20.0 - x / 36.0 + x * x * 5.0 / 504.0)
        Q[1] = s * dt**3 * (1.0 / 8.0 - x / 12.0 + x * x * 5.0 / 144.0)
        Q[2] = s * dt**2 * (1.0 / 6.0 - x / 6.0 + x * x * 11.0 / 120.0)
        Q[3] = s * dt**2 * (1.0 / 3.0 - x / 4.0 + x * x * 7.0 / 60.0)
        Q[4] = s * dt * (1.0 / 2.0 - x / 2.0 + x * x * 7.0 / 24.0)
    else:
        F[1], F[2] = (x - 1.0 + e) / rate**2, (1.0 - e) / rate
        Q[0] = (1.0 - e * e + 2.0 * x + 2.0 * x**3 / 3.0 - 2.0 * x * x - 4.0 * x * e) / rate**4
        Q[1] = (1.0 + e * e - 2.0 * e + 2.0 * x * e - 2.0 * x + x * x) / rate**3
        Q[2] = (1.0 - e * e - 2.0 * x * e) / rate**2
        Q[3] = (4.0 * e - 3.0 - e * e + 2.0 * x) / rate**2
        Q[4] = (1.0 + e * e - 2.0 * e) / rate
    Q[5] = 1.0 - e * e
    white = WHITE_SHARE * 2.0 / rate
    Q[0] += white * dt**3 / 3.0
    Q[1] += white * dt * dt / 2.0
    Q[3] += white * dt


@part
def advance_state(x: Array, F: Array) -> None:
    """Advance a state that begins with the target's."""
    for a in range(3):
        x[a] += F[0] * x[3 + a] + F[1] * x[6 + a]
        x[3 + a] += F[2] * x[6 + a]
        x[6 + a] *= F[3]


@part
def advance(P: Array, F: Array) -> None:
    """Advance a covariance that begins with the target's states, without noise."""
    n = len(P)
    for a in range(3):
        for j in range(n):
            P[a, j] += F[0] * P[3 + a, j] + F[1] * P[6 + a, j]
            P[3 + a, j] += F[2] * P[6 + a, j]
            P[6 + a, j] *= F[3]
    for j in range(n):
        for a in range(3):
            P[j, a] += F[0] * P[j, 3 + a] + F[1] * P[j, 6 + a]
            P[j, 3 + a] += F[2] * P[j, 6 + a]
            P[j, 6 + a] *= F[3]


@part
def disturb(P: Array, a: int, Q: Array, variance: float) -> None:
    """Add the noise of axis ``a`` to a covariance."""
    v, w = 3 + a, 6 + a
    P[a, a] += variance * Q[0]
    P[v, v] += variance * Q[3]
    P[w, w] += variance * Q[5]
    P[a, v] += variance * Q[1]
    P[a, w] += variance * Q[2]
    P[v, w] += variance * Q[4]
    P[v, a], P[w, a], P[w, v] = P[a, v], P[a, w], P[v, w]


@part
def advance_errors(x: Array, P: Array, base: int, dt: float, errors: Array) -> None:
    """Advance the errors of one vehicle, the states from ``base`` on, by ``dt`` (s).

    ``errors`` (2 · number,): variance and rate of decay (1/s) of each.
    """
    n = len(x)
    for kind in range(len(errors) // 2):
        i = base + kind
        variance, rate = errors[2 * kind], errors[2 * kind + 1]
        keep = exp(-dt * rate)
        x[i] *= keep
        for j in range(n):
            P[i, j] *= keep
        for j in range(n):
            P[j, i] *= keep
        P[i, i] += variance * (1.0 - keep * keep)
