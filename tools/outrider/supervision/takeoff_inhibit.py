"""Take-off inhibit: orders to take off are answered and dropped while a condition is not met."""

from __future__ import annotations

from collections.abc import Sequence

from pymavlink.dialects.v20 import all as mavlink

from companion.telemetry.reception import LINKS
from companion.values.components import COMPONENT
from mavlink_bridge.messages import CommandAck, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Frame, leading_frames
from mavlink_bridge.wire.header import command_of
from mavlink_bridge.wire.signing import Signing


class TakeoffInhibit:
    """Filter of orders to the companion of ``system``; ``signing``: the companion's, None for none."""

    def __init__(self, system: int, signing: Signing | None) -> None:
        self._own = Source(system, COMPONENT)
        self._codec = Codec(None, signing, LINKS.index("ground"))

    def closed(self, inbox: Sequence[Datagram]) -> tuple[list[Datagram], list[Datagram]]:
        """Return ``inbox`` without orders to take off for this companion, and COMMAND_ACKs that deny them."""
        passed, answers = [], []
        for datagram in inbox:
            frames, end = leading_frames(datagram.data) if datagram.link == "ground" else ((), 0)
            goes = [frame for frame in frames if self._is_go(frame)]
            if not goes:
                passed.append(datagram)
                continue
            others = b"".join(frame.data for frame in frames if frame not in goes) + datagram.data[end:]
            passed.append(Datagram("ground", others))
            for go in goes:
                command, result = mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_RESULT_DENIED
                answer = CommandAck(self._own, command, result, 0, 0, go.system, go.component)
                answers.append(Datagram("ground", self._codec.encode(answer)))
        return passed, answers

    def _is_go(self, frame: Frame) -> bool:
        if frame.message_id != mavlink.MAVLINK_MSG_ID_COMMAND_LONG:
            return False
        return command_of(frame.payload) == (mavlink.MAV_CMD_NAV_TAKEOFF, *self._own)
