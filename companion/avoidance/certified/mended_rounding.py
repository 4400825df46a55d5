"""Mending of a rounded plan that breaks a separating plane: accelerations change by single units of the wire.

A solution that lies on planes may break them once it is rounded. If there is room behind them, a solution
that keeps them by the rounding error has none of this. Between a plane and a limit there may be none, as
for a vehicle that brakes above the floor of its box below another one. Then the rounded plan is changed.

Each step of the change finds the control point that breaks its plane by the largest distance, and the axis
along which this plane's normal is longest. Along this axis it changes two successive accelerations: the
last one that moves this control point by one unit towards the plane's free side, and the next one by one
unit back. So that point moves by half a unit times dt², or by a whole one where it is the second of its
segment, and all later ones by a whole one. Only the velocity at the knot between the two accelerations
changes. An acceleration changes by up to ``MOST_UNITS``, and a place by the sum of all steps, both more than
by rounding: so the result must be checked for its limits (``plan_limits``), too, and for its planes and its
length like any rounded plan.
"""

from __future__ import annotations

import numpy as np

from companion.avoidance.certified.committed import accelerations_of, controls, with_accelerations
from companion.avoidance.certified.separating_planes import Planes
from mavlink_bridge.wire.plan import WirePlan

MOST_UNITS = 8
"""Largest change of an acceleration (mm/s²); plans of the QP keep their bounds by 10 mm/s²."""
_MOST_STEPS = 64
_SPARE_M = 1e-12
"""Distance (m) beyond each plane that covers the rounding of this module's sums."""


def mended(plan: WirePlan, planes: Planes) -> WirePlan | None:
    """Return a plan beside ``plan``, which ends at rest as well, that keeps ``least`` of all ``planes``.

    Returns None if single units lead to none, as between two planes that face each other, and if an
    acceleration would change by more than ``MOST_UNITS``.
    """
    rounded = accelerations_of(plan)
    changed = rounded.copy()
    for _ in range(_MOST_STEPS):
        found = with_accelerations(plan, changed)
        room = np.einsum("mki,kji->mkj", planes.normals, controls(found)) - planes.least
        # The beginning alone determines the first two control points.
        room[:, 0, :2] = np.inf
        obstacle, segment, point = map(int, np.unravel_index(int(room.argmin()), room.shape))
        if room[obstacle, segment, point] >= _SPARE_M:
            return found
        # The last acceleration that moves this control point; the plan's last one ends at rest.
        last = segment - 1 if point < 2 else segment
        last = min(last, len(changed) - 2)
        normal = planes.normals[obstacle, segment]
        axis = int(np.abs(normal).argmax())
        unit = 1 if normal[axis] > 0.0 else -1
        changed[last, axis] += unit
        changed[last + 1, axis] -= unit
        if np.abs(changed - rounded).max() > MOST_UNITS:
            return None
    return None
