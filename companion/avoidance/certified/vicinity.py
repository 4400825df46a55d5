"""Vicinity of a vehicle with ``certified.range``: whom it counts, and how far its plans may reach.

A vehicle counts another from a message of it on that does not show that it is beyond the range, until one
that does. Only those that it counts need agreements. All points of a plan lie within a box (``plan_sides``),
so that two vehicles of which one does not count the other cannot meet before they have heard each other; the
condition and its proof are in docs/certified.md.

The range is a horizontal distance: a vehicle that takes off or lands may be at any height.
"""

from __future__ import annotations

from math import hypot

import numpy as np

from companion.avoidance.certified.committed import horizon_of
from companion.avoidance.certified.margins import fastest, sideways
from companion.avoidance.certified.peer_plans import StoredPlan
from companion.config import CompanionConfig
from companion.errors import CompanionError
from companion.values.horizon import Array


class Vicinity:
    """Test of who is certainly beyond the range of ``config``, which must have one."""

    def __init__(self, config: CompanionConfig) -> None:
        certified = config.certified
        if certified.range is None:
            raise CompanionError("certified.range is null")
        self._beyond = certified.range + 2.0 * sideways(certified, config.field, config.limits)
        self._speed, self._knots = fastest(config.limits), certified.knots

    def beyond(self, now: int, place: Array, plan: StoredPlan) -> bool:
        """Return whether a vehicle with ``plan`` is certainly beyond the range at ``now`` (µs).

        ``place`` (3,), m: where the own plan is then. The vehicle flies its plan in the plan's epoch. Before
        it flies to the place where the plan begins, afterwards from the place where the plan is at the end
        of the epoch, and never faster than plans may.
        """
        begins = plan.plan.epoch
        ends = begins + self._knots * plan.plan.dt
        if begins <= now < ends:
            # Exact, so that two vehicles at rest decide alike throughout the epoch. With a bound from its
            # ends they would part at these and meet in the middle, and never have an agreement.
            return _apart(place, horizon_of(plan.plan).at(now).position) > self._beyond
        return any(
            _apart(place, there) - 1e-6 * abs(now - time) * self._speed > self._beyond
            for time, there in (
                (begins, plan.controls[0, 0]),
                (ends, plan.rested[self._knots - 1, 2]),
            )
        )


def _apart(place: Array, there: Array) -> float:
    """Return the horizontal distance (m) of two places."""
    return hypot(place[0] - there[0], place[1] - there[1])


def region(own: Array, towards: Array, sides: Array) -> Array:
    """Return the box (2, 3), m, from corner to corner, that holds the next plan.

    It holds the committed plan ``own`` (n, 3, 3), m, and has the ``sides`` (3,), m, or those of the committed
    plan where these are longer. What is left of them is on the side ``towards`` (3,), m, where the plan
    should end.
    """
    points = own.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    room = np.maximum(sides - (high - low), 0.0)
    above = np.clip(towards - high, 0.0, room)
    below = np.clip(low - towards, 0.0, room)
    rest = 0.5 * (room - above - below)
    return np.stack([low - below - rest, high + above + rest])


def within_region(own: Array, points: Array, sides: Array) -> bool:
    """Return whether a plan ``points`` (n, 3, 3), m, is as compact as it must be.

    On each axis it is no longer than ``sides`` (3,), m, or than the committed plan ``own`` (n, 3, 3), m.
    """
    lengths = [np.ptp(plan.reshape(-1, 3), axis=0) for plan in (own, points)]
    return bool((lengths[1] <= np.maximum(sides, lengths[0])).all())
