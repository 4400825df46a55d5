"""What leaves a companion, seen at the last moment: a tap that counts frames, commands and set-points."""

from __future__ import annotations

from collections import Counter
from struct import Struct
from typing import Final

from companion.config.planning import LimitsConfig
from mavlink_bridge.loops.lockstep import Direction
from mavlink_bridge.messages import SetpointLocal
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import leading_frames
from outrider.fly.setpoint_check import gauge_for

_COMMAND_LONG, _SETPOINT = 76, 84
_COMMAND: Final = Struct("<28xH")


class Departures:
    """``messages`` by link, ``commands`` to the autopilot by their number, and ``setpoints``."""

    def __init__(self, limits: LimitsConfig, compensation: float = 0.0) -> None:
        """``compensation``: what may be added to a plan's acceleration, m/s²."""
        self.messages: Counter[str] = Counter()
        self.commands: Counter[int] = Counter()
        self.setpoints = gauge_for(limits, compensation=compensation)
        self.newest: SetpointLocal | None = None
        self._codec = Codec(lambda identifier, _system, _component: identifier == _SETPOINT)

    def begin(self, now: int, node: str, /) -> None:
        """Nothing to do."""

    def __call__(self, now: int, node: str, direction: Direction, datagram: Datagram, /) -> None:
        if direction != "out":
            return
        for frame in leading_frames(datagram.data)[0]:
            self.messages[datagram.link] += 1
            if frame.message_id == _COMMAND_LONG:
                (command,) = _COMMAND.unpack_from(frame.payload.ljust(_COMMAND.size, b"\0"))
                self.commands[command] += 1
            elif frame.message_id == _SETPOINT:
                for message in self._codec.feed(frame.data, whole=True):
                    if isinstance(message, SetpointLocal):
                        self.take(now, message)

    def take(self, now: int, message: SetpointLocal) -> None:
        """A set-point that leaves at ``now`` (µs), or would."""
        self.setpoints.take(now, message)
        self.newest = message
