"""Bound on jerk, as rows of the QPs: |a(0) − a₋| ≤ j·h, |a(n) − a(n − 1)| ≤ j·dt.

a₋ is the acceleration flown until now, and h the time since the last plan began, at most dt: with frequent
replanning a plan may change its first acceleration only slightly. An autopilot shapes faster changes on its
own, late (PSC_JERK_XY), and then the vehicle is not where the plan says.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from companion.values.compiled import FLOAT, VOID, array, kernel, output
from companion.values.horizon import Array


class Flown(NamedTuple):
    """Motion that a plan continues: the ``acceleration`` (3,), m/s², flown until now.

    ``elapsed``: time (s) since the planner was last called; ∞ for the first plan.
    """

    acceleration: Array
    elapsed: float


class JerkRows:
    """Rows for ``n`` = N + 1 accelerations per axis, ``dt`` (s) apart, with ``j_max`` (3,), m/s³.

    ``D`` (n, n) is their matrix: it gives a(0), and the differences of consecutive accelerations.
    """

    def __init__(self, n: int, dt: float, j_max: Array) -> None:
        self.D: Array = np.eye(n) - np.eye(n, k=-1)
        self._dt = dt
        self._step: Array = np.repeat((j_max * dt)[:, None], n, axis=1)
        self.j_max = j_max
        self._count = np.arange(n)

    def bounds(self, flown: Flown) -> tuple[Array, Array]:
        """Return lower and upper bounds (3, n) of D a."""
        first = self.j_max * min(flown.elapsed, self._dt)
        low, high = -self._step.copy(), self._step.copy()
        low[:, 0], high[:, 0] = flown.acceleration - first, flown.acceleration + first
        return low, high

    def reach(self, flown: Flown) -> tuple[Array, Array]:
        """Return the least and the greatest accelerations (3, n), m/s², that the rows allow."""
        grown = self.j_max[:, None] * (min(flown.elapsed, self._dt) + self._dt * self._count)
        start = flown.acceleration[:, None]
        return start - grown, start + grown

    def limited(self, wanted: Array, low: Array, high: Array) -> Array:
        """Return accelerations (n,) of one axis that follow ``wanted`` (n,) as fast as its rows allow.

        ``low`` and ``high`` (n,) are the bounds of these rows.
        """
        found, last = np.empty_like(wanted), 0.0
        for n in range(len(wanted)):
            last = min(max(float(wanted[n]), last + float(low[n])), last + float(high[n]))
            found[n] = last
        return found


def rate_limited(force: Array, last: Array, first: float, step: float) -> Array:
    """Return the field ``force`` (N + 1, 3), m/s², with its changes limited in norm.

    The change from ``last`` (3,), the last plan's field at this time, to ``force[0]`` is at most ``first``;
    the change from each step to the next is at most ``step``.
    """
    found = np.empty_like(force)
    _rate_limited(force, last, first, step, found)
    return found


@kernel(VOID, array(2), array(1), FLOAT, FLOAT, output(2))
def _rate_limited(force: Array, last: Array, first: float, step: float, found: Array) -> None:
    """Write ``rate_limited`` to ``found`` (N + 1, 3)."""
    x, y, z = last[0], last[1], last[2]
    most = first
    for n in range(len(force)):
        dx, dy, dz = force[n, 0] - x, force[n, 1] - y, force[n, 2] - z
        size = sqrt(dx * dx + dy * dy + dz * dz)
        if size > most:
            x, y, z = x + dx * (most / size), y + dy * (most / size), z + dz * (most / size)
        else:
            x, y, z = force[n, 0], force[n, 1], force[n, 2]
        found[n, 0], found[n, 1], found[n, 2] = x, y, z
        most = step
