"""Destination of the formation ``perception``: the turn along the surface, and the stand-off.

The turn is the sum of the descent of |s| (``viewpoints``), from the present bearings, and of the way out of
hidden bearings (``hiding``), within what ``speed`` allows until the end of the horizon. It changes the
destination only, so every kind of avoidance keeps its constraints.
"""

from __future__ import annotations

from math import copysign, hypot, pi

import numpy as np

from companion.config import CompanionConfig
from companion.config.formation import Perception
from companion.config.obstacles import Post, Sphere
from companion.goals.field_of_view import in_view
from companion.goals.hiding import box_arcs, fixed_occluder, hidden_arcs, vehicle_occluder, way_out
from companion.goals.viewpoints import Crossing, anisotropy, aside, descent, weight
from companion.obstacles.boxes import boxes_of
from companion.values.boxes import BoxIndex
from companion.values.horizon import Array
from companion.values.mates import Mates, Sight

_ASIDE_RAD = 0.1
"""Turn by which a vehicle leaves a saddle, rad."""
_REST_RAD = 0.03
"""Smaller turns of the descent are not flown, and larger ones are smaller by this, rad."""
_MIN_RADIUS_M = 0.5
"""Radius of the surface below which it is not turned along."""


class PerceptionFormation:
    """Formation of the vehicle of ``system``; ``lookahead_s``: time (s) from now to the end of a plan."""

    def __init__(
        self, config: CompanionConfig, formation: Perception, system: int, lookahead_s: float
    ) -> None:
        self._formation, self._system, self._ahead = formation, system, lookahead_s
        self._crossing = Crossing()
        self._fixed = [fixed_occluder(one) for one in config.obstacles if isinstance(one, Sphere | Post)]
        self._boxes = BoxIndex(boxes_of(config.obstacles))

    def turn(self, now: int, target: Array, offset: Array, place: Array, mates: Mates, sight: Sight) -> float:
        """Return the angle (rad), counter-clockwise, by which to turn the destination ``place`` (3,).

        ``offset`` (3,): the vehicle's from ``target`` (3,), and ``place`` the surface's nearest point, also
        an offset from the target; m.
        """
        radius = hypot(place[0], place[1])
        if radius < _MIN_RADIUS_M:
            return 0.0
        formation = self._formation
        largest = formation.speed * self._ahead / radius
        ids, offsets = self._ring(offset, place, mates, target)
        own, apart = ids.index(self._system), min(formation.apart / radius, 0.5 * pi)
        bearings = np.arctan2(offsets[:, 1], offsets[:, 0])
        weights = self._weights(ids, offsets, sight)
        turns = descent(bearings, weights, sight.prior, formation.around, apart)
        crossing = self._crossing.sense(now, own, bearings, apart, float(turns[own]))
        if crossing:
            return crossing * largest
        s, total = anisotropy(bearings, weights, sight.prior), float(np.abs(weights).sum())
        if abs(s) > _ASIDE_RAD * total:
            turns = turns + aside(bearings, weights, sight.prior, _ASIDE_RAD)
        turn = formation.gain * float(turns[own])
        # The last steps gain nothing, and noise would keep the vehicles moving.
        turn = copysign(max(abs(turn) - _REST_RAD, 0.0), turn)
        occluders = [*self._fixed, *map(vehicle_occluder, mates.positions)]
        arcs = hidden_arcs(target, place, occluders, formation.clear)
        within = radius + formation.clear
        near = self._boxes.near(target[:2] - within, target[:2] + within)
        arcs += box_arcs(target, place, self._boxes.boxes.chosen(near), formation.clear)
        turn += formation.hidden_gain * way_out(float(bearings[own]), arcs, left=self._system % 2 == 0)
        return max(-largest, min(largest, turn))

    def standoff(self, place: Array, sigma: float) -> Array:
        """Return ``place`` (3,), m, an offset from the target, where its camera has the target in view.

        ``sigma`` (m): σ of the target's position.
        """
        view = self._formation.view
        return place if view is None else in_view(view, place, sigma)

    def _ring(self, offset: Array, place: Array, mates: Mates, target: Array) -> tuple[list[int], Array]:
        """Return the ids (K), ascending, and the offsets (K, 3), m, of those that take part."""
        offsets = mates.positions - target
        far = self._formation.reach * float(np.linalg.norm(place))
        near = np.flatnonzero(np.sqrt(np.vecdot(offsets, offsets)) < far)
        ids = np.array([self._system, *(mates.ids[row] for row in near)])
        order = np.argsort(ids)
        return ids[order].tolist(), np.vstack([offset, offsets[near]])[order]

    def _weights(self, ids: list[int], offsets: Array, sight: Sight) -> Array:
        """Return w_k (K,), 1/m², of the cameras ``ids`` at ``offsets`` (K, 3), m, from the target."""
        distances = np.sqrt(np.vecdot(offsets, offsets))
        return np.array(
            [self._weight(system, away, sight) for system, away in zip(ids, distances, strict=True)]
        )

    def _weight(self, system: int, distance: float, sight: Sight) -> float:
        """Return w_k (1/m²) of the camera of ``system`` at ``distance`` (m) from the target.

        It is the measured one. The own camera counts as configured if it does not see the target, because
        its bearing matters once it does.
        """
        known = sight.weights.get(system, 0.0 if sight.weights else None)
        if known is None or (known == 0.0 and system == self._system):
            return float(weight(*self._formation.accuracy(system), np.array([distance]))[0])
        return known
