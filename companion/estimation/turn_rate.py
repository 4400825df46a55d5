"""Turn rate of a vehicle, estimated from the change of its velocity, and the path at that rate.

A target that runs round a bend at 4 m/s and 0.33 rad/s is 1.6 m beside the straight line at the end of a
horizon of 1.6 s. The rate is a first-order Gauss–Markov process (Singer's model, applied to the turn rate
instead of the acceleration), so the estimate decays where measurements carry no information. Where the
velocity is mostly noise the filter's gain is nearly zero and the predicted motion is straight, as without the
filter.
"""

from __future__ import annotations

from math import atan2, exp, hypot, remainder, tau
from typing import NamedTuple

import numpy as np

from companion.values.horizon import Array

_MIN_DISPLACEMENT_M = 1e-3
"""Horizontal displacement below which the course is undefined."""


class Turn(NamedTuple):
    """Turn rate (rad/s, counter-clockwise from above) and its variance."""

    rate: float
    variance: float


class Path(NamedTuple):
    """Positions (n, 3) m and velocities (n, 3) m/s, fleet-local ENU."""

    positions: Array
    velocities: Array


class TurnFilter:
    """Kalman filter of one state, the turn rate.

    ``sigma`` (rad/s): standard deviation of the rates that occur; ``memory`` (s): time constant of the
    process; ``sigma_velocity`` (m/s): standard deviation of the measured velocities.
    """

    def __init__(self, sigma: float, memory: float, sigma_velocity: float) -> None:
        self._variance, self._memory, self._noise = sigma**2, memory, sigma_velocity**2
        self.prior = Turn(0.0, self._variance)

    def updated(self, turn: Turn, dt: float, before: tuple[float, float], now: tuple[float, float]) -> Turn:
        """Return the estimate ``dt`` seconds later.

        ``before`` and ``now``: the horizontal velocity (m/s) before and after. ``turn`` is returned unchanged
        if ``sigma`` is 0 or ``dt`` is not positive; below 1 mm of displacement the estimate only decays.
        """
        if self._variance == 0.0 or dt <= 0.0:
            return turn
        decay = exp(-dt / self._memory)
        rate, variance = decay * turn.rate, decay**2 * turn.variance + (1.0 - decay**2) * self._variance
        speed = min(hypot(*before), hypot(*now))
        if speed * dt < _MIN_DISPLACEMENT_M:
            return Turn(rate, variance)
        measured = remainder(atan2(now[1], now[0]) - atan2(before[1], before[0]), tau) / dt
        gain = variance / (variance + 2.0 * self._noise / (speed * dt) ** 2)
        return Turn(rate + gain * (measured - rate), (1.0 - gain) * variance)


def turning_path(position: Array, velocity: Array, rate: float, seconds: Array) -> Path:
    """Return the path from ``position`` (3,), m, at ``velocity`` (3,), m/s, after each of ``seconds`` (n,).

    The course turns at ``rate`` (rad/s, counter-clockwise); horizontal and vertical speed stay constant.
    """
    if rate == 0.0:
        straight = position + np.multiply.outer(seconds, velocity)
        velocities = np.empty(straight.shape)
        velocities[:] = velocity
        return Path(straight, velocities)
    angle = rate * seconds
    # sin(ωt)/ω and (1 − cos(ωt))/ω, in a form that is exact also where ω is nearly 0.
    along = seconds * np.sinc(angle / np.pi)
    aside = 0.5 * angle * seconds * np.sinc(0.5 * angle / np.pi) ** 2
    x, y, z = velocity
    c, s = np.cos(angle), np.sin(angle)
    return Path(
        position + np.column_stack([along * x - aside * y, aside * x + along * y, seconds * z]),
        np.column_stack([c * x - s * y, s * x + c * y, np.full(len(seconds), z)]),
    )
