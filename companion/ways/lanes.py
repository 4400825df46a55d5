"""Lanes that two vehicles cannot share: where one has to give way, and whom it waits for.

Vehicles that meet head on in such a lane press against each other's planes for ever. So each works out the
next steps of all on a lattice (``giving_way.py``), from where the newest plans end and from the goals that
all tell. If it meets another one within these steps, it aims along its own ones: ahead, aside, or back. The
smaller id has priority, before all that have been at their goals. Vehicles that have received other things
may expect other steps; that costs time, and no distance: sub-goals change only the cost of plans.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from companion.ways.clearance import Clearance
from companion.ways.giving_way import Lengths, step
from companion.ways.lattice import Lattice
from companion.ways.subgoal import Subgoal
from companion.ways.traveller import Traveller

_STEPS = 8
"""Number of steps that are looked ahead."""


class Lanes:
    """Lanes among the obstacles of ``clear``, for a vehicle that keeps a ``clearance`` (m).

    ``apart`` (m): distance of the places at which vehicles stand beside each other.
    """

    def __init__(self, clear: Clearance, clearance: float, apart: float) -> None:
        self._clear, self._clearance = clear, clearance
        self._lattice = Lattice(clear, clearance, apart)

    def subgoal(self, own: int, travellers: Mapping[int, Traveller]) -> Subgoal | None:
        """Return where the vehicle ``own`` among ``travellers``, by id, aims for; None where it meets none.

        It meets another one if that is on its way within the next steps, or keeps it from its way.
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
        path = self._path(me, at, goals, reached, lengths)
        others = {place for one, place in enumerate(at) if one != me}
        if path == self._alone(at[me], lengths[me]) and not others.intersection(path):
            return None
        return self._along(path, others, travellers[own], goals[me], lengths[me])

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

    def _path(
        self, me: int, at: list[int], goals: list[int], reached: list[bool], lengths: list[Lengths]
    ) -> list[int]:
        """Return the places of the vehicle ``me`` now and after each step of all."""
        path = [at[me]]
        for _ in range(_STEPS):
            there = [place == goal for place, goal in zip(at, goals, strict=True)]
            reached = [one or now for one, now in zip(reached, there, strict=True)]
            order = sorted(
                range(len(at)), key=[*zip(reached, there, range(len(at)), strict=True)].__getitem__
            )
            at = step(at, order, lengths, self._lattice.beside)
            path.append(at[me])
        return path

    def _alone(self, place: int, lengths: Lengths) -> list[int]:
        """Return the places now and after each step of a vehicle that meets none."""
        path = [place]
        for _ in range(_STEPS):
            (place,) = step([place], [0], [lengths], self._lattice.beside)
            path.append(place)
        return path

    def _along(
        self, path: list[int], others: set[int], own: Traveller, goal: int, lengths: Lengths
    ) -> Subgoal:
        """Return the furthest place of the ``path`` that is seen from the end of the plan.

        The path counts up to where it waits or turns back, or where one of the ``others`` is now: beside a
        vehicle that is to leave a place across the own way, one that presses into it would keep it there.
        """
        places, chosen = self._lattice.places, path[0]
        for index, node in enumerate(path[1:], 1):
            if node in path[:index] or node in others:
                break
            if not self._clear.sees(own.rest, places[node], self._clearance):
                break
            chosen = node
        place = places[chosen].copy()
        if chosen == goal and self._clear.sees(own.rest, own.goal, self._clearance):
            place = own.goal.copy()
        place[2] = own.goal[2]
        return Subgoal(place, self._lattice.apart * float(lengths[chosen]))
