"""Where a plan should end, in view of the places that others have: a free one on a surface or by a goal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.certified.free_place import covered, free_place
from companion.avoidance.certified.peers import Peers
from companion.avoidance.certified.surface_places import Candidate, Taken, place_of
from companion.avoidance.certified.told_goals import ToldGoals
from companion.avoidance.certified.way_obstacles import BESIDE_M, WayObstacles
from companion.avoidance.field.planner import Aim
from companion.config import CompanionConfig
from companion.config.formation import Nearest
from companion.errors import SurfaceError
from companion.surfaces import Surface
from companion.values.horizon import Array

_ON_SURFACE_M = 0.01
"""Distance of a destination from the surface up to which it is on it, and not moved off it by a limit."""
_ROUNDING_M = 1e-6


class Places:
    """Chooses where plans of the vehicle ``own`` (system id) end.

    ``obstacles``: what is fixed or rests there; ``told``: goals of the others.
    """

    def __init__(self, config: CompanionConfig, own: int, told: ToldGoals, obstacles: WayObstacles) -> None:
        self._config, self._own, self._told, self._obstacles = config, own, told, obstacles
        # Another formation has places of its own.
        self._assigns = isinstance(config.formation, Nearest)
        limits = config.limits.within(config.field.margin(1))
        self._low, self._high = np.array(limits.box_min), np.array(limits.box_max)
        self._height = 1.0 / config.field.downwash

    def destination(self, now: int, epoch: int, rest: Array, aim: Aim, peers: Peers) -> Array:
        """Return where the plan of the epoch after ``epoch`` (µs) should end at ``now`` (µs), (3,), m.

        ``rest`` (3,), m: where the committed plan ends. ``aim``: with the destination without the others.
        """
        if aim.surface is None:
            return self._beside_goal(now, epoch, rest, aim.destination, peers)
        return self._on_surface(rest, aim, aim.surface, peers) if self._assigns else aim.destination

    def _on_surface(self, rest: Array, aim: Aim, surface: Surface, peers: Peers) -> Array:
        target, destination = aim.target_end, aim.destination
        ends, left = peers.ends(), peers.left
        if not ends and not left:
            return destination
        reach = self._obstacles.between + BESIDE_M
        taken = [
            Taken(last.controls[-1, 2] - target, self._obstacles.from_last(last) + BESIDE_M, 0.0)
            for last in left.values()
        ]
        candidates = [Candidate(self._own, rest - target, surface)]
        surface_of = self._config.surface_of
        candidates += [Candidate(system, end - target, surface_of(system)) for system, end in ends.items()]
        try:
            wanted = surface.nearest(destination - target)
            off = destination - target - wanted
            if off @ off > _ON_SURFACE_M**2:
                return destination

            def allowed(places: Array, ends: Array) -> NDArray[np.bool_]:
                return self._allowed(places + target, ends + target)

            place = place_of(self._own, candidates, taken, reach, wanted, self._height, allowed)
        except SurfaceError:
            return destination
        return destination if place is wanted else target + place

    def _allowed(self, places: Array, ends: Array) -> NDArray[np.bool_]:
        """Return whether plans may end at each of ``places`` (n, 3), m: in the box, clear of what is fixed.

        ``ends`` (n, 3) or (3,), m: where the newest plans end, whose heights those in a plane keep.
        """
        first = 2 if self._config.planar else 3
        low, high = self._low[:first] - _ROUNDING_M, self._high[:first] + _ROUNDING_M
        inside = ((places[:, :first] >= low) & (places[:, :first] <= high)).all(axis=1)
        if not self._config.obstacles or not inside.any():
            return np.asarray(inside)
        if self._config.planar:
            places = np.column_stack([places[:, :2], np.broadcast_to(ends[..., 2], len(places))])
        return np.asarray(inside & self._obstacles.fixed.clear(places))

    def _beside_goal(self, now: int, epoch: int, rest: Array, goal: Array, peers: Peers) -> Array:
        """Return ``goal`` (3,), m, or the nearest free place if a vehicle that said farewell covers it.

        The goals of those that ask for room are not free, unless there is no other place.
        """
        left = peers.left
        if not left:
            return goal
        ends = np.array([last.controls[-1, 2, :2] for last in left.values()])
        radii = np.array([self._obstacles.from_last(last) for last in left.values()])
        if not covered(goal[:2], ends, radii):
            return goal
        asking = [one.position_m for one in self._told.recent(now).values() if one.room]
        for discs in self._obstacles.resting(epoch, rest, goal, peers, asking):
            place = free_place(goal[:2], discs, self._low[:2], self._high[:2])
            if place is not None:
                return np.array([place[0], place[1], goal[2]])
        return goal
