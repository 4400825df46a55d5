"""Lanes that two vehicles cannot share: where one has to give way, and whom it waits for.

Vehicles that meet head on in such a lane press against each other's planes for ever. So each works out the
next steps of all on a lattice (``giving_way.py``), from where the newest plans end and from the goals that
all tell. If it meets another one within these steps, or others stand beside the line to where it would go
without lanes, it aims along its own steps: ahead, aside, or back. The smaller id has priority, before all
that have been at their goals. Vehicles that have received other things may expect other steps; that costs
time, and no distance: sub-goals change only the cost of plans.

Goals are beside the lattice's places. A vehicle that stands at its goal may be nearer to another place than
two vehicles can be, although its own place is not. So it stands at its place while another one comes there.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot

import numpy as np

from companion.values.horizon import Array
from companion.ways.balls import Balls
from companion.ways.clearance import Clearance
from companion.ways.giving_way import Lengths, step
from companion.ways.lattice import Lattice
from companion.ways.subgoal import Subgoal
from companion.ways.traveller import Traveller

_STEPS = 8
"""Number of steps that are looked ahead."""
_SEEN = 0.9
"""Share of the clearance that plans keep with which places are seen: a plan slides round an edge."""
_ROUNDING_M = 1e-6


class Lanes:
    """Lanes among the obstacles of ``clear``, for a vehicle that keeps a ``clearance`` (m).

    ``apart`` (m): distance of the places at which vehicles stand beside each other. ``kept`` (m): clearance
    that plans keep; others push vehicles out of the lines between places, but not nearer to obstacles.
    """

    def __init__(self, clear: Clearance, clearance: float, apart: float, kept: float) -> None:
        self._clear, self._seen = clear, _SEEN * kept
        self._lattice = Lattice(clear, clearance, apart)

    def subgoal(
        self, own: int, travellers: Mapping[int, Traveller], aim: Array, between: float
    ) -> Subgoal | None:
        """Return where the vehicle ``own`` among ``travellers``, by id, aims for; None where it meets none.

        It meets another one if that is on its way within the next steps, keeps it from its way, or comes near
        its goal while it stands there. Without lanes it would go to ``aim`` (3,), m. It goes by its steps,
        too, where others that stay there stand nearer to that line than plans keep ``between`` them (m), and
        the next step passes them.
        """
        systems = sorted(travellers)
        at = self._places(systems, travellers)
        goals = [self._lattice.nearest(travellers[one].goal) for one in systems]
        if min(at, default=-1) < 0 or min(goals) < 0:
            return None
        me = systems.index(own)
        if not self._leads(at[me], goals[me]):
            return None
        goals = [goal if self._leads(here, goal) else here for here, goal in zip(at, goals, strict=True)]
        lengths = [self._lattice.lengths(goal) for goal in goals]
        reached = [travellers[one].reached for one in systems]
        paths = self._paths(at, goals, reached, lengths)
        path = _without_return(paths, me, reached) if reached[me] else [places[me] for places in paths]
        others = {place for one, place in enumerate(at) if one != me}
        hinders = goals[me] in path and self._hinders(
            me, paths, goals, [travellers[one].goal for one in systems]
        )
        rest = travellers[own].rest
        stay = [travellers[systems[one]].rest for one in _staying(paths) if one != me]
        stand = Balls(np.array(stay).reshape(-1, 3), np.full(len(stay), between), np.zeros(len(stay)))
        around = stand.without(rest)
        meets = hinders or path != self._alone(at[me], lengths[me]) or not others.isdisjoint(path)
        if not meets:
            here, there = self._lattice.places[path[:2]]
            if _passed(around, rest, aim) or not _passed(stand, here, there):
                return None
        seen = self._seen_along(path, others, rest)
        node = self._passing(seen, rest, around)
        return self._towards(node, travellers[own], None if hinders else goals[me], lengths[me])

    def at_goal(self, rest: Array, goal: Array) -> bool:
        """Return whether a plan that ends at ``rest`` (3,) ends at the place of its ``goal`` (3,), m."""
        node = self._lattice.nearest(goal)
        return node >= 0 and node == self._lattice.nearest(rest)

    def _leads(self, here: int, goal: int) -> bool:
        """Return whether a way on the lattice leads from the place ``here`` to ``goal``."""
        return int(self._lattice.lengths(goal)[here]) < len(self._lattice.places)

    def _places(self, systems: list[int], travellers: Mapping[int, Traveller]) -> list[int]:
        """Return the places at which the plans of ``systems`` end, a different one for each; −1 for none.

        Of several at one place the nearest has it.
        """
        lattice, found, taken = self._lattice, dict[int, int](), set[int]()
        off = {}
        for one in systems:
            rest = travellers[one].rest
            node = lattice.nearest(rest)
            off[one] = float(np.abs(lattice.places[node] - rest)[:2].max()) if node >= 0 else 0.0
        for one in sorted(systems, key=lambda system: (round(off[system], 3), system)):
            found[one] = lattice.nearest(travellers[one].rest, taken)
            taken.add(found[one])
        return [found[one] for one in systems]

    def _paths(
        self, at: list[int], goals: list[int], reached: list[bool], lengths: list[Lengths]
    ) -> list[list[int]]:
        """Return the places of all vehicles now and after each step."""
        paths = [at]
        for _ in range(_STEPS):
            there = [place == goal for place, goal in zip(at, goals, strict=True)]
            reached = [one or now for one, now in zip(reached, there, strict=True)]
            order = sorted(
                range(len(at)), key=[*zip(reached, there, range(len(at)), strict=True)].__getitem__
            )
            at = step(at, order, lengths, self._lattice.beside)
            paths.append(at)
        return paths

    def _hinders(self, me: int, paths: list[list[int]], goals: list[int], aims: list[Array]) -> bool:
        """Return whether another one comes nearer to the goal of ``me`` than two vehicles stand apart.

        ``aims`` (3,), m: the goals; others that stand at the places of their ``goals`` stand at them.
        """
        lattice = self._lattice
        for places in paths:
            for one, place in enumerate(places):
                if one == me:
                    continue
                stands = aims[one] if place == goals[one] else lattice.places[place]
                x, y = (stands - aims[me])[:2].tolist()
                if hypot(x, y) < lattice.apart - _ROUNDING_M:
                    return True
        return False

    def _alone(self, place: int, lengths: Lengths) -> list[int]:
        """Return the places now and after each step of a vehicle that meets none."""
        path = [place]
        for _ in range(_STEPS):
            (place,) = step([place], [0], [lengths], self._lattice.beside)
            path.append(place)
        return path

    def _seen_along(self, path: list[int], others: set[int], rest: Array) -> list[int]:
        """Return the places of the ``path`` up to the last one that is seen from ``rest`` (3,), m.

        The path counts up to where it waits or turns back, or where one of the ``others`` is now: beside a
        vehicle that is to leave a place across the own way, one that presses into it would keep it there.
        """
        for index, node in enumerate(path[1:], 1):
            if node in path[:index] or node in others:
                return path[:index]
            if not self._clear.sees(rest, self._lattice.places[node], self._seen):
                return path[:index]
        return path

    def _passing(self, path: list[int], rest: Array, stand: Balls) -> int:
        """Return the furthest place of the ``path`` to which the line from ``rest`` (3,), m, meets no ball.

        At least it is the next place, to which the line is one of the lattice.
        """
        blocked = np.flatnonzero(~stand.passed(rest, self._lattice.places[path])[2:])
        return path[1 + int(blocked[0])] if len(blocked) else path[-1]

    def _towards(self, node: int, own: Traveller, goal: int | None, lengths: Lengths) -> Subgoal:
        """Return the place ``node`` on the way of ``own`` as its sub-goal; at its ``goal`` that itself."""
        place = self._lattice.places[node].copy()
        if node == goal and self._clear.sees(own.rest, own.goal, self._seen):
            place = own.goal.copy()
        place[2] = own.goal[2]
        return Subgoal(place, self._lattice.apart * float(lengths[node]))


def _staying(paths: list[list[int]]) -> list[int]:
    """Return the vehicles that are at one place in all of ``paths``."""
    return [one for one, places in enumerate(zip(*paths, strict=True)) if len(set(places)) == 1]


def _passed(stand: Balls, here: Array, there: Array) -> bool:
    """Return whether the line from ``here`` to ``there`` (3,), m, meets no ball."""
    return bool(stand.passed(here, there[None])[0])


def _without_return(paths: list[list[int]], me: int, reached: list[bool]) -> list[int]:
    """Return the path of ``me``, which waits where one on its way would send it back before another comes.

    Otherwise it goes while that one turns aside for it, and comes back while that one goes: each sees the end
    of the other one's plan an epoch late. Those that have ``reached`` their goals are not on their way.
    """
    path = [places[me] for places in paths]
    here = path[0]
    on_way = [one for one, done in enumerate(reached) if not done]
    for index in range(len(path) - 1, 1, -1):
        away = [k for k in range(1, index) if path[k] != here]
        if path[index] != here or any(here in paths[k] for k in away):
            continue
        entered = {path[k] for k in away}
        if any(paths[k][one] in entered for k in range(1, index + 1) for one in on_way):
            return [here] * index + path[index:]
    return path
