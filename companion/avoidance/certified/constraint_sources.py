"""Constraint sources of a certified plan: agreements with peers, fixed obstacles, non-cooperative vehicles.

All are given on the plan's own knots.
"""

from __future__ import annotations

from collections.abc import Set

import numpy as np

from companion.avoidance.certified.agreed_planes import stacked
from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.departed import DepartedVehicles
from companion.avoidance.certified.fixed_surfaces import FixedSurfaces
from companion.avoidance.certified.margins import fastest, margin
from companion.avoidance.certified.noncooperative import NonCooperative
from companion.avoidance.certified.separating_planes import Others
from companion.config import CompanionConfig
from companion.obstacles.static import Axes
from companion.values.boxes import Boxes
from companion.values.horizon import Array
from companion.world import View, World

_SIGHT_MARGIN_M = 1.0
"""Distance (m) added to the largest one at which an obstacle can constrain a plan."""


class ConstraintSources:
    """Constraint sources of one vehicle; ``around`` gives those of each plan."""

    def __init__(self, config: CompanionConfig, steps: int, fixed: FixedSurfaces) -> None:
        self._config, self._steps = config, steps
        own = config.certified
        self._departed = DepartedVehicles(config)
        self.between = self._departed.between
        """Least distance (m) between two plans."""
        self._margin = margin(own, config.field, config.limits)
        self._fixed, self._from_surfaces = fixed, fixed.least
        self._noncooperative = NonCooperative(config, steps)
        none = np.empty((0, steps, 3, 3))
        self._nothing = none, none, np.empty((0, steps)), np.empty(0)
        widest = max(self.between, self._from_surfaces)
        self._sight = steps * 1e-6 * own.dt_us * fastest(config.limits) + widest + _SIGHT_MARGIN_M

    def around(
        self,
        now: int,
        epoch: int,
        own: Array,
        goal: Array,
        agreements: Agreements,
        world: World,
        view: View,
    ) -> tuple[Others, Array]:
        """Return the constraints of the plan that begins one epoch after ``epoch`` (µs), and the field.

        They are as known at ``now`` (µs). The field f (n, 3), m/s², acts in the plan's cost only.
        ``own`` (n, 3, 3), m: the committed control points from the next epoch on. ``goal`` (3,), m: where the
        plan aims.
        """
        begins = epoch + self._config.certified.epoch_us
        left = agreements.peers.left
        aside = self._departed.beside_last_plan(now, left, world)
        # A vehicle that said farewell may drift while it descends. One that is further than ``between`` from
        # its last plan may be flown by another controller, at any height: it counts as non-cooperative while
        # it sends. Once it is silent it counts as landed at its last position, as it may be switched off.
        taken_over = {system for system, (off, _, fresh) in aside.items() if fresh and off > self.between}
        members: Set[int] = agreements.peers.members
        if left:
            members = members | (left.keys() - taken_over)
        if away := agreements.peers.away:
            members = members - away
        if distant := agreements.peers.distant:
            members = members | self._beyond_range(distant, world)
        seen = self._noncooperative.seen(begins, members, world)
        strangers = self._noncooperative.balls(seen, own)
        noncooperative = [*strangers, *self._noncooperative.target(now, begins, view)]
        sensed = world.sensed.around(epoch, own.reshape(-1, 3), self._sight)
        lasts = list(left.values())
        beside_plans = [place for system, (_, place, _) in aside.items() if system not in taken_over]
        unshared: list[tuple[Array, Array | float]] = [
            *(self._departed.final_constraint(own, last, begins) for last in lasts),
            *self._fixed_constraints(own),
            *(self._departed.rest_constraint(own, goal, last) for last in lasts),
            *(self._departed.landed_constraint(own, place, self.between) for place in beside_plans),
            *noncooperative,
            *(self._sensed_constraints(sensed) if sensed.ids else ()),
        ]
        first = len(unshared) - len(noncooperative) - len(sensed.ids)
        vehicles = [*range(len(lasts)), *range(first, first + len(strangers))]
        others = Others(
            *self._unshared(own, unshared, vehicles),
            self._boxes_near(own),
            self._from_surfaces,
            stacked(agreements.agreed(), begins, self._config.certified.dt_us, self._steps),
        )
        return others, self._noncooperative.field(seen, own, sensed)

    def _unshared(
        self, own: Array, given: list[tuple[Array, Array | float]], vehicles: list[int]
    ) -> tuple[Array, Array, Array, Array]:
        """Return the first four parts of ``Others`` for what keeps no distance itself.

        ``given``: its control points (n, 3, 3) and least distances, m, of which those of ``vehicles`` count
        heights as vehicles do.
        """
        if not given:
            return self._nothing
        distance = np.empty((len(given), self._steps))
        for index, (_, radii) in enumerate(given):
            distance[index] = radii
        heights = np.ones(len(given))
        heights[vehicles] = 1.0 / self._config.field.downwash
        return np.stack([own] * len(given)), np.stack([one for one, _ in given]), distance, heights

    def _beyond_range(self, distant: dict[int, int], world: World) -> set[int]:
        """Return those of the ``distant`` vehicles that constrain no plan.

        They are all but those whose position was received more than ``contact_us`` after their last plan or
        statement: such a vehicle may have come without a companion that plans.
        """
        contact = self._config.certified.contact_us
        received = world.neighbours.last_received()
        unplanned = {s for s, time, _, _ in received if s in distant and time > distant[s] + contact}
        return distant.keys() - unplanned

    def _fixed_constraints(self, own: Array) -> list[tuple[Array, float]]:
        """Return the fixed obstacles near the plan: spheres at their centres, posts at the plan's height.

        So posts act as if they had no top.
        """
        found: list[tuple[Array, float]] = []
        if not self._fixed.round:
            return found
        points = own.reshape(-1, 3)
        for fixed, upright in ((self._fixed.balls, False), (self._fixed.posts, True)):
            if not len(fixed):
                continue
            _, positions, radii = fixed.around(points, self._sight)
            for place, radius in zip(positions.reshape(-1, self._steps, 3, 3), radii, strict=True):
                centres = place.copy()
                if upright:
                    centres[..., 2] = own[..., 2]
                found.append((centres, self._from_surfaces + radius))
        return found

    def _boxes_near(self, own: Array) -> Boxes | None:
        """Return the boxes near the plan ``own`` (n, 3, 3), m; None where no box is configured.

        In a plane of fixed height those far above or below it are left out.
        """
        boxes = self._fixed.boxes
        if not len(boxes.boxes.centres):
            return None
        points = own.reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        found = boxes.boxes.chosen(boxes.near(low[:2] - self._sight, high[:2] + self._sight))
        if not self._config.planar:
            return found
        above = np.abs(found.centres[:, 2] - 0.5 * (low[2] + high[2])) - found.halves[:, 2]
        return found.chosen(np.flatnonzero(above < self._from_surfaces + 0.5 * (high[2] - low[2])))

    def _sensed_constraints(self, sensed: Axes) -> list[tuple[Array, float]]:
        """Return what sensors detect, and the predicted paths of traffic, as fixed obstacles.

        If an obstacle appears nearer to the committed plan than the least distance, its planes keep only the
        present distance; the field then moves the plan away.
        """
        least = self._config.field.d_min + self._margin
        places = sensed.positions.reshape(-1, self._steps, 3, 3)
        return [(place, least + radius) for place, radius in zip(places, sensed.radius, strict=True)]
