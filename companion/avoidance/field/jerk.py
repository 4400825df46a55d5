"""The bound on jerk, as rows of the QPs: |a(0) − a₋| ≤ j·h, |a(n) − a(n − 1)| ≤ j·dt.

a₋ is the acceleration that is flown until now, and h the time since the last plan began: replanned often, a
plan may change its first acceleration but little. An autopilot shapes what changes faster on its own, late
(PSC_JERK_XY), and then the vehicle is not where the plan says.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from companion.values.horizon import Array


class Flown(NamedTuple):
    """What a plan goes on from: the acceleration (3,), m/s², flown until now, and for how long (s) the plan
    that it comes from has been flown."""

    acceleration: Array
    elapsed: float


class JerkRows:
    """For N + 1 accelerations an axis, ``dt`` seconds apart, with ``j_max`` (3,) m/s³. ``D`` (n, n): the
    matrix of the rows."""

    def __init__(self, n: int, dt: float, j_max: Array) -> None:
        self.D: Array = np.eye(n) - np.eye(n, k=-1)
        self._dt = dt
        self._step: Array = np.repeat((j_max * dt)[:, None], n, axis=1)
        self._j_max = j_max
        self._count = np.arange(n)

    def bounds(self, flown: Flown) -> tuple[Array, Array]:
        """Lower and upper bounds (3, n) of D a."""
        first = self._j_max * min(flown.elapsed, self._dt)
        low, high = -self._step.copy(), self._step.copy()
        low[:, 0], high[:, 0] = flown.acceleration - first, flown.acceleration + first
        return low, high

    def reach(self, flown: Flown) -> tuple[Array, Array]:
        """The least and the greatest accelerations (3, n) that the rows leave."""
        grown = self._j_max[:, None] * (min(flown.elapsed, self._dt) + self._dt * self._count)
        start = flown.acceleration[:, None]
        return start - grown, start + grown

    def limited(self, wanted: Array, low: Array, high: Array) -> Array:
        """The accelerations (n,) of one axis that follow ``wanted`` (n,) as fast as its rows' bounds ``low``,
        ``high`` (n,) let them."""
        found, last = np.empty_like(wanted), 0.0
        for n in range(len(wanted)):
            last = min(max(float(wanted[n]), last + float(low[n])), last + float(high[n]))
            found[n] = last
        return found


def rate_limited(force: Array, last: Array, first: float, step: float) -> Array:
    """A field (N + 1, 3) whose change is limited in norm: by ``first`` from ``last`` (3,) on, by ``step``
    from one n to the next."""
    found = np.empty_like(force)
    most = first
    for n in range(len(force)):
        change = force[n] - last
        size = float(np.sqrt(change @ change))
        last = last + change * (most / size) if size > most else force[n]
        found[n] = last
        most = step
    return found
