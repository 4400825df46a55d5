"""Constraint sources of a certified plan: agreements with peers, fixed obstacles, non-cooperative vehicles.

All are given on the plan's own knots.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from math import dist, hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.certified.agreed_planes import stacked
from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.columns import levelled
from companion.avoidance.certified.committed import horizon_of
from companion.avoidance.certified.margins import beside, between, fastest, from_surfaces, further, margin
from companion.avoidance.certified.noncooperative import NonCooperative
from companion.avoidance.certified.peer_plans import StoredPlan
from companion.avoidance.certified.separating_planes import Others
from companion.avoidance.certified.visibility_graph import Discs, Rectangles, rectangles
from companion.config import CompanionConfig
from companion.config.obstacles import Post, Sphere
from companion.obstacles.boxes import boxes_of
from companion.obstacles.static import Axes, FixedObstacles
from companion.values.boxes import Boxes, BoxIndex, distances
from companion.values.horizon import Array
from companion.ways.balls import Balls
from companion.world import View, World

_SIGHT_MARGIN_M = 1.0
"""Distance (m) added to the largest one at which an obstacle can constrain a plan."""

_RESTED_US, _AT_REST_M = 2_000_000, 0.5
"""A vehicle rests if its newest plan ends where it was this time (µs) ago, within this distance (m).

Vehicles that jostle for room rest for a shorter time, and the turn of the goal resolves that.
"""
_NEAR = 2.0
"""Distance from a landed vehicle, in least distances from it, below which one rests because of it."""
_OVER = 0.5
"""Share of the least distance from a departed vehicle below which a plan that ends higher ends over it."""
_TOWARDS_M = 0.05
"""Distance (m) of the goal from the end of the plan below which it gives no direction."""
BESIDE_M = 0.05
"""Distance (m) of a way from what plans must keep clear of."""
_AROUND_M, _MOST_BOXES = 20.0, 8
"""How far (m) beside the ends of a way boxes are looked at, and how many of them at most."""


class ConstraintSources:
    """Constraint sources of one vehicle; ``around`` gives those of each plan."""

    def __init__(self, config: CompanionConfig, steps: int) -> None:
        self._config, self._steps = config, steps
        own = config.certified
        self.between = between(own, config.field, config.limits)
        """Least distance (m) between two plans."""
        self._further = further(own)
        self._margin = margin(own, config.field, config.limits)
        self._from_surfaces = from_surfaces(own, config.field, config.limits)
        """Least distance (m) of a plan from a surface."""
        self._beside = beside(own, config.field, config.limits)
        self._silent_us = config.guard.neighbour_lost_us
        self._round = [one for one in config.obstacles if isinstance(one, Post | Sphere)]
        self._posts = FixedObstacles([one for one in self._round if isinstance(one, Post)])
        self._balls = FixedObstacles([one for one in self._round if isinstance(one, Sphere)])
        self._boxes = BoxIndex(boxes_of(config.obstacles))
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
        left = agreements.left
        aside = self._beside_last_plan(now, left, world)
        # A vehicle that said farewell may drift while it descends. One that is further than ``between`` from
        # its last plan may be flown by another controller, at any height: it counts as non-cooperative while
        # it sends. Once it is silent it counts as landed at its last position, as it may be switched off.
        taken_over = {system for system, (off, _, fresh) in aside.items() if fresh and off > self.between}
        members: Set[int] = agreements.members
        if left:
            members = members | (left.keys() - taken_over)
        if away := agreements.away:
            members = members - away
        if distant := agreements.distant:
            members = members | self._beyond_range(distant, world)
        seen = self._noncooperative.seen(begins, members, world)
        strangers = self._noncooperative.balls(seen, own)
        noncooperative = [*strangers, *self._noncooperative.target(now, begins, view)]
        sensed = world.sensed.around(epoch, own.reshape(-1, 3), self._sight)
        lasts = list(left.values())
        beside_plans = [place for system, (_, place, _) in aside.items() if system not in taken_over]
        unshared: list[tuple[Array, Array | float]] = [
            *(self._final_constraint(own, last, begins) for last in lasts),
            *self._fixed_constraints(own),
            *(self._departed_constraint(own, goal, last) for last in lasts),
            *(self._landed_constraint(own, place, self.between) for place in beside_plans),
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
        if not self._round:
            return found
        points = own.reshape(-1, 3)
        for fixed, upright in ((self._balls, False), (self._posts, True)):
            if not len(fixed):
                continue
            _, positions, radii = fixed.around(points, self._sight)
            for place, radius in zip(positions.reshape(-1, self._steps, 3, 3), radii, strict=True):
                centres = place.copy()
                if upright:
                    centres[..., 2] = own[..., 2]
                found.append((centres, self._from_surfaces + radius))
        return found

    def clear_of_fixed(self, places: Array) -> NDArray[np.bool_]:
        """Return whether ``places`` (n, 3), m, are as far from all fixed obstacles as plans keep, (n,).

        Posts act as if they had no top.
        """
        least = self._from_surfaces
        clear = (self._balls.distance(places) >= least).all(axis=1)
        below = places.copy()
        below[:, 2] = -np.inf
        clear &= (self._posts.distance(below) >= least).all(axis=1)
        clear &= (distances(places, self._boxes.boxes) >= least).all(axis=1)
        return np.asarray(clear)

    def _boxes_near(self, own: Array) -> Boxes | None:
        """Return the boxes near the plan ``own`` (n, 3, 3), m; None where no box is configured.

        In a plane of fixed height those far above or below it are left out.
        """
        if not len(self._boxes.boxes.centres):
            return None
        points = own.reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        found = self._boxes.boxes.chosen(self._boxes.near(low[:2] - self._sight, high[:2] + self._sight))
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

    def _beside_last_plan(
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

    def from_last(self, last: StoredPlan) -> float:
        """Return the least distance (m) from the ``last`` plan of a vehicle that said farewell."""
        return self.between + last.plan.column * self._further

    def _final_constraint(self, own: Array, last: StoredPlan, begins: int) -> tuple[Array, float]:
        """Return the constraint of the ``last`` plan of a vehicle that said farewell, while it is flown."""
        plan = last.later(begins, self._steps)
        centres = levelled(plan, own) if last.plan.column else plan
        return centres, self.from_last(last)

    def _departed_constraint(self, own: Array, goal: Array, last: StoredPlan) -> tuple[Array, float]:
        """Return the constraint at the place where the ``last`` plan of a vehicle that said farewell rests.

        A vehicle whose own plan ends over that place, because the companion of the other one ended below it,
        leaves towards ``goal`` (3,), m. The direction away from the place would be one by chance, and may
        lead into a gap between obstacles that is too narrow. Its height is kept by ``_final_constraint``.
        """
        rest, place, least = own[-1, 2], last.controls[-1, 2], self.from_last(last)
        off, ahead = dist(rest[:2], place[:2]), dist(rest[:2], goal[:2])
        over = off < _OVER * least and rest[2] > place[2] and not self._config.planar
        if last.plan.column or not over or ahead < _TOWARDS_M:
            return self._landed_constraint(own, place, least)
        # Only the direction counts: any point so near behind the plan is nearer than ``least``.
        behind = own.copy()
        behind[..., :2] -= _TOWARDS_M / ahead * (goal[:2] - rest[:2])
        return behind, least

    def _landed_constraint(self, own: Array, place: Array, least: float) -> tuple[Array, float]:
        """Return the constraint at the ``place`` (3,), m, of a vehicle that lands or has landed.

        No vehicle flies over it within ``least`` (m): heights do not count.
        """
        return levelled(np.broadcast_to(place, own.shape), own), least

    def resting(
        self, epoch: int, here: Array, there: Array, agreements: Agreements, goals: Sequence[Array] = ()
    ) -> list[Discs]:
        """Return the discs that a way must avoid from ``epoch`` (µs) on; then those that stay for ever alone.

        They are seen from above: where posts, spheres, boxes, landed vehicles, and vehicles whose newest plan
        rests keep a vehicle away whose height is between those of ``here`` and ``there`` (3,), m, where the
        way begins and ends. ``goals`` (3,), m, of others count as if these rested there.
        """
        low, high = min(here[2], there[2]), max(here[2], there[2])
        fixed = []
        for one in self._round:
            above = 0.0 if isinstance(one, Post) else max(one.at[2] - high, low - one.at[2], 0.0)
            fixed.append((one.at[:2], self._from_surfaces + one.radius, above))
        landed = [
            (tuple(last.controls[-1, 2, :2]), self.from_last(last), 0.0) for last in agreements.left.values()
        ]
        ends = [
            (end, self._config.planar or system in agreements.columns)
            for system, end in _ends_at_rest(epoch, agreements).items()
        ]
        ends += [(goal, self._config.planar) for goal in goals]
        vehicles = []
        for end, level in ends:
            above = 0.0 if level else max(end[2] - high, low - end[2], 0.0) / self._config.field.downwash
            vehicles.append((tuple(end[:2]), self.between, above))
        rectangles = self._rectangles(here, there)
        return [
            _discs(found)._replace(rectangles=rectangles)
            for found in (fixed + landed + vehicles, fixed + landed)
        ]

    def at_rest(self, epoch: int, agreements: Agreements) -> Balls:
        """Return where others rest that a way must pass from ``epoch`` (µs) on, beside fixed obstacles.

        These are landed vehicles, and those whose newest plan rests. Of landed vehicles, of columns and in a
        plane heights do not count. Plans keep as much from these as from fixed obstacles.
        """
        places, kept, flat = [], [], []
        for last in agreements.left.values():
            places.append(last.controls[-1, 2])
            kept.append(self.from_last(last))
            flat.append(0.0)
        for system, end in _ends_at_rest(epoch, agreements).items():
            level = self._config.planar or system in agreements.columns
            places.append(end)
            kept.append(self.between)
            flat.append(0.0 if level else 1.0 / self._config.field.downwash)
        radii = np.array(kept) - self._from_surfaces
        return Balls(np.array(places).reshape(-1, 3), radii, np.array(flat))

    def occupied(self, epoch: int, goal: Array, agreements: Agreements) -> bool:
        """Return whether a vehicle rests on ``goal`` (3,), m, from ``epoch`` (µs) on, near a landed one.

        It is nearer to ``goal`` than plans keep. The landed vehicle may cover the goal of that one.
        """
        left = agreements.left
        ends = _ends_at_rest(epoch, agreements).values() if left else ()
        return any(self.apart(end - goal) < self.between and self._near_landed(end, left) for end in ends)

    def apart(self, difference: Array) -> float:
        """Return the distance (m) of two vehicles with a ``difference`` (3,), m, of places."""
        x, y, z = difference.tolist()
        return hypot(x, y, 0.0 if self._config.planar else z / self._config.field.downwash)

    def _near_landed(self, place: Array, left: Mapping[int, StoredPlan]) -> bool:
        """Return whether ``place`` (3,), m, is near a landed vehicle of those that ``left``."""
        return any(
            hypot(*(place - last.controls[-1, 2])[:2].tolist()) < _NEAR * self.from_last(last)
            for last in left.values()
        )

    def _rectangles(self, here: Array, there: Array) -> Rectangles:
        """Return where boxes keep a vehicle away on a way from ``here`` to ``there`` (3,), m.

        These are the ``_MOST_BOXES`` nearest to ``here`` of those about the way: the search takes time with
        the square of their number, and a way around those is good for the next metres.
        """
        low, high = np.minimum(here, there), np.maximum(here, there)
        rows = self._boxes.near(low[:2] - _AROUND_M, high[:2] + _AROUND_M)
        boxes = self._boxes.boxes.chosen(rows)
        above = np.maximum(boxes.centres[:, 2] - high[2], low[2] - boxes.centres[:, 2]) - boxes.halves[:, 2]
        above = np.maximum(above, 0.0)
        keep = np.flatnonzero(above < self._from_surfaces)
        radii = np.sqrt(self._from_surfaces**2 - above[keep] ** 2) + BESIDE_M
        found = rectangles(boxes.chosen(keep), radii)
        # No way leads out of a rectangle; a vehicle above or below a box may leave: planes keep it off.
        beside = (found.distance(np.stack([here[:2], there[:2]])) > 0.0).all(axis=0)
        found = Rectangles(*(part[beside] for part in found))
        if len(found.radii) <= _MOST_BOXES:
            return found
        nearest = np.argsort(found.distance(here[None, :2])[0], kind="stable")[:_MOST_BOXES]
        return Rectangles(*(part[nearest] for part in found))


def _ends_at_rest(epoch: int, agreements: Agreements) -> dict[int, Array]:
    """Return where the newest plans of vehicles that rest at ``epoch`` (µs) end (3,), m, by system id.

    Landed vehicles are left out.
    """
    resting = agreements.resting(epoch - _RESTED_US, _AT_REST_M)
    return {system: end for system, end in resting.items() if system not in agreements.left}


def _discs(found: list[tuple[tuple[float, ...], float, float]]) -> Discs:
    """Return the discs of ``found``: centre, radius, and distance above or below, m."""
    found = [one for one in found if one[2] < one[1]]
    return Discs(
        np.array([centre for centre, _, _ in found]).reshape(-1, 2),
        np.array([sqrt(radius * radius - above * above) + BESIDE_M for _, radius, above in found]),
    )
