"""Goals that vehicles tell each other, so that those that meet in a lane can give way to each other.

Each vehicle tells its goal, and whether it has been there, in a TUNNEL of its own. From the goals that were
received, and from where the newest plans end, follows where to aim for (``companion/ways/lanes.py``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from companion.values.horizon import Array
from companion.ways.subgoal import Subgoal
from companion.ways.traveller import Traveller
from mavlink_bridge.messages import Message, Source, Tunnel
from mavlink_bridge.wire.goal import PAYLOAD_TYPE, WireGoal, goal_at, pack, unpack

if TYPE_CHECKING:
    from companion.ways.way import Way

_REACHED_M = 0.2
"""Distance of the end of the plan from a goal that counts as reached, and by which a goal may move."""


class LaneGoals:
    """Own goal and those received, of the vehicle ``own`` in the frame ``origin`` (8-bit fingerprint).

    ``way``: that of the vehicle, which has the lanes; ``in_use``: whether vehicles give way in lanes.
    """

    def __init__(self, own: Source, origin: int, way: Way | None, *, in_use: bool) -> None:
        self._own, self._origin, self._way, self._in_use = own, origin, way, in_use
        self._told: dict[int, WireGoal] = {}
        self._goal: Array | None = None
        self._reached = False

    def receive(self, system: int, payload: bytes) -> None:
        """Keep the goal that ``system`` tells, unless it is in another frame.

        Raises PlanWireError if it cannot be decoded.
        """
        goal = unpack(payload)
        if goal.origin == self._origin:
            self._told[system] = goal

    def subgoal(
        self, rest: Array, destination: Array, ends: Callable[[], Mapping[int, Array]]
    ) -> Subgoal | None:
        """Return where to aim for among vehicles that cannot pass; None where none is met.

        The own plan ends at ``rest`` (3,), on the way to ``destination`` (3,); those of the others end at
        ``ends()`` (3,), by system id; m.
        """
        if not self._in_use:
            return None
        if self._goal is None or float(np.abs(self._goal - destination).max()) > _REACHED_M:
            self._reached = False
        self._goal = destination
        self._reached |= float(np.abs(rest - destination).max()) < _REACHED_M
        lanes = None if self._way is None else self._way.lanes()
        if lanes is None:
            return None
        travellers = {}
        for system, end in ends().items():
            told = self._told.get(system)
            goal, reached = (end, True) if told is None else (told.position_m, told.reached)
            travellers[system] = Traveller(end, goal, reached)
        travellers[self._own.system] = Traveller(rest, destination, self._reached)
        return lanes.subgoal(self._own.system, travellers)

    def messages(self) -> list[Message]:
        """Return the message of the own goal, where vehicles give way to each other in lanes."""
        if not self._in_use or self._goal is None:
            return []
        goal = goal_at(self._goal, self._origin, reached=self._reached)
        return [Tunnel(self._own, 0, 0, PAYLOAD_TYPE, pack(goal))]
