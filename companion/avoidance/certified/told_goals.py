"""Goals that vehicles tell each other, so that each knows where the others fly to.

A vehicle tells its goal, whether it has been there, and the room that it asks for, in a TUNNEL of its own
with each transmission of its plan. Nothing that certifies separation depends on it.
"""

from __future__ import annotations

from companion.values.horizon import Array
from mavlink_bridge.messages import Message, Source, Tunnel
from mavlink_bridge.wire.goal import PAYLOAD_TYPE, WireGoal, WireRoom, goal_at, pack, unpack

REACHED_M = 0.2
"""Distance of the end of the plan from a goal that counts as reached, and by which a goal may move."""
_VALID_US = 2_000_000
"""Time (µs) for which a goal is that of its vehicle; one that has none tells none."""


class ToldGoals:
    """Own goal and those received, of the vehicle ``own`` in the frame ``origin`` (8-bit fingerprint)."""

    def __init__(self, own: Source, origin: int) -> None:
        self._own, self._origin = own, origin
        self._received: dict[int, tuple[int, WireGoal]] = {}
        self._goal: tuple[Array, bool] | None = None
        self._room: WireRoom | None = None

    def receive(self, now: int, system: int, payload: bytes) -> None:
        """Keep the goal that ``system`` tells at ``now`` (µs), unless it is in another frame.

        Raises PlanWireError if it cannot be decoded.
        """
        goal = unpack(payload)
        if goal.origin == self._origin:
            self._received[system] = now, goal

    def recent(self, now: int) -> dict[int, WireGoal]:
        """Return the goals that are valid at ``now`` (µs), by system id."""
        return {s: goal for s, (time, goal) in self._received.items() if now - time <= _VALID_US}

    def tell(self, goal: Array | None, *, reached: bool = False, room: WireRoom | None = None) -> None:
        """Tell the ``goal`` (3,), m, whether it was ``reached``, and the ``room`` that is asked for.

        None: tell none.
        """
        self._goal, self._room = None if goal is None else (goal, reached), room

    def ask_no_room(self) -> None:
        """Ask for no room from now on, because no plan is made; the goal is told as before."""
        self._room = None

    def messages(self) -> list[Message]:
        """Return the message of the own goal, if it is told."""
        if self._goal is None:
            return []
        goal, reached = self._goal
        told = goal_at(goal, self._origin, reached=reached, room=self._room)
        return [Tunnel(self._own, 0, 0, PAYLOAD_TYPE, pack(told))]
