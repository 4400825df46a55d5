"""Vehicles that said farewell: their last plan, the place where it rests, and where they drifted.

A vehicle that lands drifts, and one that has landed may be switched off, so no vehicle flies over it.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import dist, hypot

import numpy as np

from companion.avoidance.certified.columns import levelled
from companion.avoidance.certified.committed import horizon_of
from companion.avoidance.certified.margins import beside, between, further
from companion.avoidance.certified.peer_plans import StoredPlan
from companion.config import CompanionConfig
from companion.values.horizon import Array
from companion.world import World

_NEAR = 2.0
"""Distance from a landed vehicle, in least distances from it, below which one rests because of it."""
_OVER = 0.5
"""Share of the least distance from a departed vehicle below which a plan that ends higher ends over it."""
_TOWARDS_M = 0.05
"""Distance (m) of the goal from the end of the plan below which it gives no direction."""


class DepartedVehicles:
    """Distances from vehicles that said farewell, and constraints of plans beside them."""

    def __init__(self, config: CompanionConfig) -> None:
        own = config.certified
        self._planar = config.planar
        self.between = between(own, config.field, config.limits)
        """Least distance (m) between two plans."""
        self._further = further(own)
        self._beside = beside(own, config.field, config.limits)
        self._silent_us = config.guard.neighbour_lost_us

    def from_last(self, last: StoredPlan) -> float:
        """Return the least distance (m) from the ``last`` plan of a vehicle that said farewell."""
        return self.between + last.plan.column * self._further

    def beside_last_plan(
        self, now: int, left: dict[int, StoredPlan], world: World
    ) -> dict[int, tuple[float, Array, bool]]:
        """Return the vehicles that ``left`` and have since reported a position beside their last plan.

        The values, by system id, are the horizontal distance (m) from this plan, the position (3,), m, and
        whether messages still arrive. Differences up to ``margins.beside`` are tolerated.
        """
        found: dict[int, tuple[float, Array, bool]] = {}
        if not left:
            return found
        for system, time, position, _ in world.neighbours.last_received():
            if system not in left or time < left[system].plan.epoch:
                continue
            apart = position - horizon_of(left[system].plan).at(time).position
            off = hypot(apart[0], apart[1])
            if off > self._beside:
                found[system] = off, position, now - time <= self._silent_us
        return found

    def final_constraint(self, own: Array, last: StoredPlan, begins: int) -> tuple[Array, float]:
        """Return the constraint of the ``last`` plan of a vehicle that said farewell, while it is flown."""
        plan = last.later(begins, len(own))
        centres = levelled(plan, own) if last.plan.column else plan
        return centres, self.from_last(last)

    def rest_constraint(self, own: Array, goal: Array, last: StoredPlan) -> tuple[Array, float]:
        """Return the constraint at the place where the ``last`` plan of a vehicle that said farewell rests.

        A vehicle whose own plan ends over that place, because the companion of the other one ended below it,
        leaves towards ``goal`` (3,), m. The direction away from the place would be one by chance, and may
        lead into a gap between obstacles that is too narrow. Its height is kept by ``final_constraint``.
        """
        rest, place, least = own[-1, 2], last.controls[-1, 2], self.from_last(last)
        off, ahead = dist(rest[:2], place[:2]), dist(rest[:2], goal[:2])
        over = off < _OVER * least and rest[2] > place[2] and not self._planar
        if last.plan.column or not over or ahead < _TOWARDS_M:
            return self.landed_constraint(own, place, least)
        # Only the direction counts: any point so near behind the plan is nearer than ``least``.
        behind = own.copy()
        behind[..., :2] -= _TOWARDS_M / ahead * (goal[:2] - rest[:2])
        return behind, least

    def landed_constraint(self, own: Array, place: Array, least: float) -> tuple[Array, float]:
        """Return the constraint at the ``place`` (3,), m, of a vehicle that lands or has landed.

        No vehicle flies over it within ``least`` (m): heights do not count.
        """
        return levelled(np.broadcast_to(place, own.shape), own), least

    def near(self, place: Array, left: Mapping[int, StoredPlan]) -> bool:
        """Return whether ``place`` (3,), m, is near a landed vehicle of those that ``left``."""
        return any(
            hypot(*(place - last.controls[-1, 2])[:2].tolist()) < _NEAR * self.from_last(last)
            for last in left.values()
        )
