"""Lanes that two vehicles cannot share: where one has to give way, and whom it waits for.

Vehicles that meet head on in such a lane press against each other's planes for ever. So each works out the
next steps of all on a lattice (``giving_way.py``), from where the newest plans end and from the goals that
all tell. If it meets another one within these steps, or others are beside the straight line to where it
would go alone, it aims along its own steps: ahead, aside, or back. The smaller id has priority, before all
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
    ``between`` (m): what two plans keep between them.
    """

    def __init__(
        self, clear: Clearance, clearance: float, apart: float, kept: float, between: float = 0.0
    ) -> None:
        self._clear, self._seen, self._between = clear, _SEEN * kept, between
        self._lattice = Lattice(clear, clearance, apart)

    def subgoal(self, own: int, travellers: Mapping[int, Traveller]) -> Subgoal | None:
        """Return where the vehicle ``own`` among ``travellers``, by id, aims for; None where it meets none.

        It meets another one if that is on its way within the next steps, keeps it from its way, comes near
        its goal while it stands there, or has its plan's end beside the line to the furthest place that it
        sees.
        """
        systems = sorted(travellers)
        at = self._places(systems, travellers)
        goals = [self._lattice.nearest(travellers[one].goal) for one in systems]
        if min(at, default=-1) < 0 or min(goals) < 0:
            return None
        lengths = [self._lattice.lengths(goal) for goal in goals]
        me = systems.index(own)
        if int(lengths[me][at[me]]) >= len(self._lattice.places):
            return None
        reached = [travellers[one].reached for one in systems]
        paths = self._paths(at, goals, reached, lengths)
        path = [step[me] for step in paths]
        if reached[me] and not all(reached):
            path = _without_return(paths, me)
        others = {place for one, place in enumerate(at) if one != me}
        hinders = goals[me] in path and self._hinders(
            me, paths, goals, [travellers[one].goal for one in systems]
        )
        rest = travellers[own].rest
        seen = self._seen_along(path, others, rest)
        free = self._passing(seen, rest, [one.rest for system, one in travellers.items() if system != own])
        meets = hinders or path != self._alone(at[me], lengths[me]) or not others.isdisjoint(path)
        if not meets and free == seen:
            return None
        return self._towards(free[-1], travellers[own], None if hinders else goals[me], lengths[me])

    def at_goal(self, rest: Array, goal: Array) -> bool:
        """Return whether a plan that ends at ``rest`` (3,) ends at the place of its ``goal`` (3,), m."""
        node = self._lattice.nearest(goal)
        return node >= 0 and node == self._lattice.nearest(rest)

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

    def _passing(self, path: list[int], rest: Array, others: list[Array]) -> list[int]:
        """Return the ``path`` as far as lines from ``rest`` (3,), m, to its places pass the ``others``.

        Their plans end at ``others`` (3,), m. The line to the next place is one of the lattice, beside which
        others may stand.
        """
        if len(path) < 3 or not others:
            return path
        count = len(others)
        balls = Balls(np.array(others), np.full(count, self._between), np.zeros(count)).without(rest)
        free = balls.passed(rest, self._lattice.places[path])
        blocked = np.flatnonzero(~free[2:])
        return path[: 2 + int(blocked[0])] if len(blocked) else path

    def _towards(self, node: int, own: Traveller, goal: int | None, lengths: Lengths) -> Subgoal:
        """Return the place ``node`` on the way of ``own`` as its sub-goal; at its ``goal`` that itself."""
        place = self._lattice.places[node].copy()
        if node == goal and self._clear.sees(own.rest, own.goal, self._seen):
            place = own.goal.copy()
        place[2] = own.goal[2]
        return Subgoal(place, self._lattice.apart * float(lengths[node]))


def _without_return(paths: list[list[int]], me: int) -> list[int]:
    """Return the path of ``me``, which waits where it would come back before another one has been there.

    Otherwise it may go and come back in turn with one that is on its way, and that sees the ends of its plans
    an epoch late.
    """
    path = [places[me] for places in paths]
    here = path[0]
    for index in range(len(path) - 1, 1, -1):
        between = zip(path[1:index], paths[1:index], strict=True)
        if path[index] == here and not any(here in places for own, places in between if own != here):
            return [here] * index + path[index:]
    return path
