"""Room that vehicles at their goals make for one that cannot get on.

Vehicles at their goals close gaps for others. One to which those that rest leave no way asks for room: it
tells its goal and the next place on its way (``told_goals.py``). A vehicle that has been at its goal stands
aside while its goal is in the corridor from the end of the other's plan to that place, and returns
afterwards. Where those that rest leave it no place beside the corridor, it asks for room, too, with a rank
one higher. A vehicle stands aside for lower ranks than its own, and for a lower id of the same rank; so no
two wait for each other. One on whose goal another one rests near a landed vehicle asks with the highest rank:
for it nobody leaves a goal, but a vehicle leaves the free place beside its own covered goal (``places.py``).
Only destinations change; planes keep all distances.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.free_place import covered, free_places
from companion.avoidance.certified.peers import Peers
from companion.avoidance.certified.told_goals import REACHED_M, ToldGoals
from companion.avoidance.certified.visibility_graph import Discs, free, without
from companion.avoidance.certified.way_obstacles import WayObstacles
from companion.config import CompanionConfig
from companion.values.horizon import Array
from companion.values.vectors import limit
from mavlink_bridge.wire.goal import WireRoom, room_to

_WIDE, _KEPT = 1.1, 1.03
"""Half width of a corridor in least distances of plans: for a new place beside it, and for the place where a
vehicle already stands."""
_LONG = 2.0
"""Longest corridor in least distances of plans."""
_PART = 0.3
"""Distance of the discs that make a corridor, in least distances of plans."""
_MOST_RANK = 7
"""Rank from which on no vehicle leaves its goal. Free places (``places.py``) avoid goals of all ranks."""


class _Asking(NamedTuple):
    """Vehicle ``system`` (id), on the way to its ``goal`` (3,), m, and the ``room`` that it asks for."""

    system: int
    goal: Array
    room: WireRoom


class Room:
    """Room that the vehicle ``own`` (system id) asks for and makes, beside its ``obstacles``."""

    def __init__(self, config: CompanionConfig, own: int, told: ToldGoals, obstacles: WayObstacles) -> None:
        self._own, self._told, self._obstacles = own, told, obstacles
        limits = config.limits.within(config.field.margin(1))
        self._low, self._high = np.array(limits.box_min[:2]), np.array(limits.box_max[:2])
        self._planar, self._downwash = config.planar, config.field.downwash
        self._goal: Array | None = None
        self._reached = self._there = self._asks = self._occupied = False
        self._aside: Array | None = None
        self._rank = 0
        self._closed_at: Array = np.zeros(3)
        self.moved = False
        """Whether ``destination`` is another place than when it was called before, for the same goal."""

    def destination(self, now: int, epoch: int, rest: Array, goal: Array, peers: Peers) -> Array:
        """Return where to go at ``now`` (µs): the ``goal`` (3,), m, or a place beside corridors.

        These are the corridors of those that ask. The plan of ``epoch`` (µs) ends at ``rest`` (3,), m.
        """
        before = self._aside
        if self._goal is None or float(np.abs(self._goal - goal).max()) > REACHED_M:
            self._reached = self._asks = False
            self._rank, self._aside = 0, None
        self._goal = goal
        self._there = float(np.abs(rest - goal).max()) < REACHED_M
        self._reached |= self._there
        self._asks &= not self._there
        self._aside = self._place(now, epoch, rest, goal, peers) if self._reached else None
        self.moved = before is not self._aside
        return goal if self._aside is None else self._aside

    def asked(self, rest: Array, subgoal: Array, *, closed: bool, occupied: bool) -> WireRoom | None:
        """Return the room that the vehicle asks for from ``rest`` to its ``subgoal`` (3,), m; None for none.

        ``closed``: those that rest leave no way to its goal. It asks until they do and the end of its plan
        has gone on by the length of a corridor, or is at the goal. ``occupied``: one rests on the goal near a
        landed vehicle. Without ``closed`` it asks with the highest rank, for which no vehicle leaves its
        goal.
        """
        only = occupied and not closed and (self._occupied or not self._asks)
        if (closed or only) and not self._there and self._aside is None:
            self._occupied, self._asks, self._closed_at = only, True, rest
        longest = _LONG * self._obstacles.between
        self._asks &= float(np.linalg.norm(rest - self._closed_at)) < longest
        if self._aside is not None and self._rank == 0:
            return None
        if not self._asks and self._aside is None:
            return None
        rank = _MOST_RANK if self._aside is None and self._occupied else self._rank
        return room_to(rest + limit(subgoal - rest, longest), rank)

    def _place(self, now: int, epoch: int, rest: Array, goal: Array, peers: Peers) -> Array | None:
        """Return the place to stand at while ``goal`` (3,), m, is in a corridor; None if it is in none."""
        asking = self._asking(now, goal)
        ends = peers.ends() if asking else {}
        wide = [self._corridor(one, ends.get(one.system), goal, _WIDE) for one in asking]
        counted = [index for index, discs in enumerate(wide) if covered(goal[:2], discs.centres, discs.radii)]
        if not counted:
            self._rank = 0
            return None
        resting, fixed = self._obstacles.resting(epoch, rest, goal, peers)
        if self._aside is not None:
            kept = [self._corridor(one, ends.get(one.system), goal, _KEPT) for one in asking]
            if not any(covered(self._aside[:2], discs.centres, discs.radii) for discs in kept):
                return self._aside
        # The first have the lowest ranks: if there is no place for all, there is one for these.
        for discs, rank in ((resting, 0), (fixed, 1)):
            for among in (wide, wide[counted[0] : counted[0] + 1]):
                places = free_places(goal[:2], _together(discs, among), self._low, self._high)
                seen = np.flatnonzero(free(rest[:2], places, without(rest[:2], discs)))
                if len(seen):
                    found, first = places[seen[0]], asking[counted[0]]
                    self._rank = first.room.rank + 1 if rank else 0
                    place = np.array([found[0], found[1], goal[2]])
                    aside = self._aside
                    stays = aside is not None and float(np.abs(aside - place).max()) < REACHED_M
                    return aside if stays else place
        return self._aside

    def _asking(self, now: int, goal: Array) -> list[_Asking]:
        """Return those that ask for room before this vehicle, the lowest rank first.

        Not those whose goal is so near to the own ``goal`` (3,), m, that both cannot be reached.
        """
        asks = self._asks and not self._occupied
        mine = (self._rank if asks or self._rank else inf, self._own)
        found = []
        for system, one in self._told.recent(now).items():
            if one.room is None or one.room.rank >= _MOST_RANK or (one.room.rank, system) >= mine:
                continue
            if one.room.rank or self._obstacles.apart(one.position_m - goal) >= self._obstacles.between:
                found.append(_Asking(system, one.position_m, one.room))
        return sorted(found, key=lambda one: (one.room.rank, one.system))

    def _corridor(self, asking: _Asking, end: Array | None, goal: Array, wide: float) -> Discs:
        """Return the discs at the height of ``goal`` (3,), m, of the corridor from ``end`` (3,) on.

        That of a vehicle on the way to its goal includes the place around it.
        """
        between = self._obstacles.between
        onwards = asking.room.next_place_m
        first = onwards if end is None else end
        # What others tell is not bounded.
        last = first + limit(onwards - first, _LONG * between)
        length = float(np.linalg.norm(last - first))
        parts = max(1, int(length / (_PART * between)))
        places = [first + share * (last - first) for share in np.linspace(0.0, 1.0, parts + 1)]
        if asking.room.rank == 0:
            places.append(asking.goal)
        centres = np.array(places)
        above = np.zeros(len(centres)) if self._planar else (centres[:, 2] - goal[2]) / self._downwash
        square = (wide * between) ** 2 - above**2
        near = square > 0.0
        return Discs(centres[near, :2], np.sqrt(square[near]))


def _together(discs: Discs, corridors: list[Discs]) -> Discs:
    """Return ``discs`` and those of all ``corridors``."""
    return discs._replace(
        centres=np.vstack([discs.centres, *(one.centres for one in corridors)]),
        radii=np.concatenate([discs.radii, *(one.radii for one in corridors)]),
    )
