"""How fast a thing turns, learnt from how its velocity did, and where it comes if it goes on turning so.

Who runs round a bend at 4 m/s and 0.33 rad/s is 1.6 m beside the straight line by the end of a horizon of
1.6 s. The rate is a first-order Gauss–Markov process (Singer's model, of the turn rate instead of the
acceleration): what is not seen any more is forgotten, and where the velocity is all noise the filter's gain
is nearly zero and the motion straight, as without it.
"""

from __future__ import annotations

from math import atan2, exp, hypot, remainder, tau
from typing import NamedTuple

import numpy as np

from companion.values.horizon import Array

_NEAR = 1e-3
"""m; who has gone less than this has no course."""


class Turn(NamedTuple):
    """Turn rate (rad/s, counter-clockwise from above) and its variance."""

    rate: float
    variance: float


class Path(NamedTuple):
    """Positions (n, 3) m and velocities (n, 3) m/s, fleet-local ENU; the latter may be read-only."""

    positions: Array
    velocities: Array


class TurnFilter:
    """A Kalman filter of one state: ``sigma`` (rad/s) of the rates that occur, forgotten in ``memory`` (s);
    ``sigma_velocity`` (m/s): how exact the velocities are."""

    def __init__(self, sigma: float, memory: float, sigma_velocity: float) -> None:
        self._variance, self._memory, self._noise = sigma**2, memory, sigma_velocity**2
        self.unknown = Turn(0.0, self._variance)

    def after(self, turn: Turn, dt: float, before: tuple[float, float], now: tuple[float, float]) -> Turn:
        """What is known ``dt`` seconds later, when the horizontal velocity went from ``before`` to
        ``now``."""
        if self._variance == 0.0 or dt <= 0.0:
            return turn
        kept = exp(-dt / self._memory)
        rate, variance = kept * turn.rate, kept**2 * turn.variance + (1.0 - kept**2) * self._variance
        speed = min(hypot(*before), hypot(*now))
        if speed * dt < _NEAR:
            return Turn(rate, variance)
        seen = remainder(atan2(now[1], now[0]) - atan2(before[1], before[0]), tau) / dt
        share = variance / (variance + 2.0 * self._noise / (speed * dt) ** 2)
        return Turn(rate + share * (seen - rate), (1.0 - share) * variance)


def carried(position: Array, velocity: Array, rate: float, seconds: Array) -> Path:
    """The motion (3,), (3,) at each of ``seconds`` (n,) later: its course turns at ``rate`` (rad/s), its
    speed and its vertical speed stay."""
    if rate == 0.0:
        straight = position + np.multiply.outer(seconds, velocity)
        return Path(straight, np.broadcast_to(velocity, straight.shape))
    angle = rate * seconds
    # sin(ωt)/ω and (1 − cos(ωt))/ω, whole also where ω is nearly 0.
    along = seconds * np.sinc(angle / np.pi)
    aside = 0.5 * angle * seconds * np.sinc(0.5 * angle / np.pi) ** 2
    x, y, z = velocity
    c, s = np.cos(angle), np.sin(angle)
    return Path(
        position + np.column_stack([along * x - aside * y, aside * x + along * y, seconds * z]),
        np.column_stack([c * x - s * y, s * x + c * y, np.full(len(seconds), z)]),
    )
