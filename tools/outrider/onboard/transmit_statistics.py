"""Transmit statistics: a tap of the loop that counts outgoing frames and commands and checks set-points."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pymavlink.dialects.v20 import all as mavlink

from companion.config.planning import LimitsConfig
from mavlink_bridge.loops.lockstep import Direction
from mavlink_bridge.messages import SetpointLocal
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import leading_frames
from mavlink_bridge.wire.header import command_of
from outrider.onboard.setpoint_check import setpoint_check


class TransmitStatistics:
    """Counters of a companion's outgoing frames, and the check of its set-points.

    ``messages``: number of frames by link. ``commands``: number of COMMAND_LONG messages, on any link, by
    MAV_CMD. ``setpoints``: the check. ``newest``: the last set-point, None before the first.
    """

    def __init__(self, limits: LimitsConfig, compensation: float = 0.0) -> None:
        """Start the counters; ``compensation``: maximum addition to a plan's acceleration (m/s²)."""
        self.messages: Counter[str] = Counter()
        self.commands: Counter[int] = Counter()
        self.setpoints = setpoint_check(limits, compensation=compensation)
        self.newest: SetpointLocal | None = None
        self._codec = Codec(
            lambda identifier, _system, _component: (
                identifier == mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED
            )
        )

    def begin(self, now: int, node: str, /) -> None:
        """Do nothing; the protocol of taps requires this method."""

    def __call__(self, now: int, node: str, direction: Direction, datagrams: Sequence[Datagram], /) -> None:
        """Count the frames of outgoing datagrams, and check their set-points."""
        if direction == "out":
            for datagram in datagrams:
                self._count(now, datagram)

    def _count(self, now: int, datagram: Datagram) -> None:
        for frame in leading_frames(datagram.data)[0]:
            self.messages[datagram.link] += 1
            if frame.message_id == mavlink.MAVLINK_MSG_ID_COMMAND_LONG:
                self.commands[command_of(frame.payload).command] += 1
            elif frame.message_id == mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED:
                for message in self._codec.feed(frame.data, whole=True):
                    if isinstance(message, SetpointLocal):
                        self.take(now, message)

    def take(self, now: int, message: SetpointLocal) -> None:
        """Add a set-point that is sent, or would be sent, at ``now`` (µs)."""
        self.setpoints.take(now, message)
        self.newest = message
