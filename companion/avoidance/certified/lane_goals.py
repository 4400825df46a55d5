"""Where to aim for among vehicles that meet in a lane and give way to each other.

From the goals that they tell each other, and from where the newest plans end, follows where to aim for
(``companion/ways/lanes.py``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from companion.avoidance.certified.told_goals import REACHED_M, ToldGoals
from companion.values.horizon import Array
from companion.ways.subgoal import Subgoal
from companion.ways.traveller import Traveller

if TYPE_CHECKING:
    from companion.ways.way import Way


class LaneGoals:
    """Sub-goals in lanes of the vehicle ``own`` (system id).

    ``goals``: those that are told. ``way``: that of the vehicle, which has the lanes. ``between`` (m): what
    two plans keep between them. ``in_use``: whether vehicles give way in lanes.
    """

    def __init__(self, own: int, goals: ToldGoals, way: Way | None, between: float, *, in_use: bool) -> None:
        self._own, self._goals, self._way, self._between, self._in_use = own, goals, way, between, in_use
        self._goal: Array | None = None
        self._reached = False

    def subgoal(
        self,
        now: int,
        rest: Array,
        destination: Array,
        aim: Array,
        ends: Callable[[], Mapping[int, Array]],
    ) -> Subgoal | None:
        """Return where to aim for at ``now`` (µs) among vehicles that cannot pass; None where none is met.

        The own plan ends at ``rest`` (3,), on the way to ``destination`` (3,), and would aim for ``aim``
        (3,); those of the others end at ``ends()`` (3,), by system id; m. One that has not told its goal
        lately stays where it is.
        """
        if not self._in_use:
            return None
        if self._goal is None or float(np.abs(self._goal - destination).max()) > REACHED_M:
            self._reached = False
        self._goal = destination
        lanes = None if self._way is None else self._way.lanes()
        self._reached |= float(np.abs(rest - destination).max()) < REACHED_M or (
            lanes is not None and lanes.at_goal(rest, destination)
        )
        self._goals.tell(destination, reached=self._reached)
        if lanes is None:
            return None
        travellers, recent = {}, self._goals.recent(now)
        for system, end in ends().items():
            told = recent.get(system)
            goal, reached = (end, True) if told is None else (told.position_m, told.reached)
            travellers[system] = Traveller(end, goal, reached)
        travellers[self._own] = Traveller(rest, destination, self._reached)
        return lanes.subgoal(self._own, travellers, aim, self._between)
