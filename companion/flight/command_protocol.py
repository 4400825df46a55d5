"""Command protocol (COMMAND_LONG and COMMAND_ACK): repeats each command until it is acknowledged."""

from __future__ import annotations

from collections import deque
from math import isnan

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import CommandAck, CommandLong, Message, Source

_RETRY_US = 500_000
"""µs between two transmissions of an unacknowledged command."""
_EXPIRY_US = 15_000_000
"""µs from the transmission of an acknowledged command until ``call`` repeats it; longer than a take-off."""

_MAX_REFUSALS = 16

_Call = tuple[int, tuple[float, ...]]


class Commands:
    """Commands sent to the autopilot of ``own``'s system, and its answers.

    ``refusals``: descriptions of the last refusals, at most 16.
    """

    def __init__(self, own: Source) -> None:
        self.own = self._own = own
        self.refusals: deque[str] = deque(maxlen=_MAX_REFUSALS)
        self.refused = 0
        """Number of refusals; a repetition of a command's last result is not counted."""
        self._results: dict[_Call, int] = {}
        self._acknowledged: set[_Call] = set()
        self._answered: set[_Call] = set()
        self._sent: dict[_Call, int] = {}
        self._asked: dict[int, _Call] = {}

    def receive(self, message: CommandAck) -> None:
        """Receive an acknowledgement, unless it is addressed to another component.

        COMMAND_ACK contains the command id alone and is assigned to the last command sent with this id. In
        MAVLink 1 it has no addressee (0).
        """
        own = self._own
        if message.target_system not in (0, own.system) or message.target_component not in (0, own.component):
            return
        call = self._asked.pop(message.command, None)
        if call is None:
            return
        self._answered.add(call)
        if message.result in (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS):
            self._acknowledged.add(call)
        elif self._results.get(call) != message.result:
            self.refused += 1
            self.refusals.append(f"command {message.command}: result {message.result}")
        self._results[call] = message.result

    def sent_at(self, command: int, params: tuple[float, ...]) -> int:
        """Return when (µs) the command was last sent, 0 for never."""
        return self._sent.get(_key(command, params), 0)

    def answered(self, command: int, params: tuple[float, ...]) -> bool:
        """Return whether the autopilot has accepted or refused the command."""
        return _key(command, params) in self._answered

    def taken(self, now: int, command: int, params: tuple[float, ...], within: int) -> bool:
        """Return whether the command was accepted, and last sent at most ``within`` µs before ``now``."""
        key = _key(command, params)
        return key in self._acknowledged and now - self._sent.get(key, now) <= within

    def forget(self) -> None:
        """Forget all commands and answers."""
        self._sent.clear()
        self._asked.clear()
        self._acknowledged.clear()
        self._answered.clear()
        self._results.clear()

    def call(self, now: int, command: int, params: tuple[float, ...]) -> list[Message]:
        """Return the command to send at ``now`` (µs), or an empty list.

        It is not sent if it was acknowledged and sent at most 15 s ago, was sent less than half a second ago,
        or must wait for its turn: COMMAND_ACK contains the command id alone, so only one command with the
        same id may be open at a time.
        """
        key = _key(command, params)
        if key in self._acknowledged and now - self._sent.get(key, now) > _EXPIRY_US:
            # The caller still wants the command: it had no effect, and is sent again.
            self._acknowledged.discard(key)
        if key in self._acknowledged or self._recent(now, key) or self._recent(now, self._asked.get(command)):
            return []
        self._sent[key], self._asked[command] = now, key
        p1, p2, p3, p4, p5, p6, p7 = params
        target = self._own.system, mavlink.MAV_COMP_ID_AUTOPILOT1
        return [CommandLong(self._own, *target, command, 0, (p1, p2, p3, p4, p5, p6, p7))]

    def _recent(self, now: int, call: _Call | None) -> bool:
        return call is not None and now - self._sent.get(call, -_RETRY_US) < _RETRY_US


def _key(command: int, params: tuple[float, ...]) -> _Call:
    # NaN parameters are left out, because NaN does not equal itself.
    return command, tuple(p for p in params if p == p) if isnan(sum(params)) else params
