"""Check of a plan that was changed after its rounding: it passes limits no further than rounding may.

The QP keeps the limits of acceleration, its change, speed and place, relaxed to what the committed plan has.
Rounding moves each acceleration but the last by at most half a unit of the wire (1 mm/s²), and the last one,
which brings the plan to rest, by at most n − 1 times as much. So it moves changes, speeds and places by at
most the sums of these, and a rounded plan may pass their limits by so much. A changed plan may do the same,
and no more. The accelerations of a changed plan stay within their limits, or within what the committed plan
has: the QP leaves room for their rounding.
"""

from __future__ import annotations

import numpy as np

from companion.avoidance.certified.committed import accelerations_of
from companion.config.planning import LimitsConfig
from companion.values.horizon import Array
from mavlink_bridge.wire.plan import WirePlan

_HALF_M_S2 = 0.5e-3
"""Largest rounding error (m/s²) of an acceleration."""
_EXACT = 1e-9
"""Difference (SI units) that covers the rounding of this module's sums."""


class PlanLimits:
    """Limits of plans with ``steps`` knots of ``dt_us`` (µs)."""

    def __init__(self, steps: int, dt_us: int, limits: LimitsConfig) -> None:
        self._dt = 1e-6 * dt_us
        knots: Array = np.arange(1.0, steps + 1.0)[:, None]
        of_changes: Array = np.full((steps + 1, 1), 2.0 * _HALF_M_S2)
        of_changes[0] = _HALF_M_S2
        of_changes[-2:] = [steps * _HALF_M_S2], [(steps - 1) * _HALF_M_S2]
        half_way, after = (knots - 1) * knots, knots**2
        of_places: Array = 0.5 * _HALF_M_S2 * self._dt**2 * np.stack([half_way, after], axis=1)
        of_speeds: Array = _HALF_M_S2 * self._dt * knots
        change: Array = np.full(3, np.inf) if limits.j_max is None else self._dt * np.array(limits.j_max)
        # Of accelerations, their changes, velocities, and places.
        self._least: tuple[Array, ...] = (
            np.array(limits.least_u),
            -change,
            np.array(limits.least_v),
            np.array(limits.box_min),
        )
        self._most: tuple[Array, ...] = (
            np.array(limits.u_max),
            change,
            np.array(limits.v_max),
            np.array(limits.box_max),
        )
        self._by_rounding: tuple[Array, ...] = np.zeros(1), of_changes, of_speeds, of_places

    def kept(self, committed: WirePlan, own: Array, plan: WirePlan, points: Array, before: Array) -> bool:
        """Return whether ``plan`` passes no limit further than the ``committed`` one or than by rounding.

        ``own``, ``points`` (n, 3, 3), m: control points of the committed plan and of ``plan``, which begin at
        one state; ``before`` (3,), m/s²: the acceleration until then.
        """
        was, found = self._values(committed, own, before), self._values(plan, points, before)
        bounds = zip(self._least, self._most, self._by_rounding, was, found, strict=True)
        for least, most, rounding, old, new in bounds:
            room = rounding + _EXACT
            if (new < np.minimum(least, old) - room).any() or (new > np.maximum(most, old) + room).any():
                return False
        return True

    def _values(self, plan: WirePlan, points: Array, before: Array) -> tuple[Array, ...]:
        """Return accelerations, their changes from ``before`` to the rest, velocities, and control points."""
        accelerations: Array = 1e-3 * accelerations_of(plan).astype(np.float64)
        changes: Array = np.diff(accelerations, axis=0, prepend=before[None], append=0.0)
        summed: Array = np.cumsum(accelerations, axis=0)
        velocities: Array = plan.velocity_m_s + self._dt * summed
        return accelerations, changes, velocities, points[:, 1:]
