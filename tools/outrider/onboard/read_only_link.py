"""Read-only link: last filter of a dry run; it sends only frames that do not affect a vehicle."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from companion.dry_run import REQUESTS
from mavlink_bridge.links.link import Link, LinkCounters
from mavlink_bridge.wire.framing import Frame, leading_frames
from mavlink_bridge.wire.header import command_of

_HARMLESS: Final = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
        mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT,
        mavlink.MAVLINK_MSG_ID_STATUSTEXT,
    )
)


class ReadOnlyLink:
    """Wrapper of ``link`` that sends only heartbeats, status, and requests for messages, parameters and time.

    ``kept``: number of dropped datagrams.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self.kept = 0

    @property
    def counters(self) -> LinkCounters:
        """Counters of the wrapped link."""
        return self._link.counters

    def fileno(self) -> int | None:
        """Return the file descriptor of the wrapped link."""
        return self._link.fileno()

    def receive(self) -> list[bytes]:
        """Return the datagrams received on the wrapped link."""
        return self._link.receive()

    def send(self, data: bytes) -> None:
        """Send ``data`` if it consists of whole harmless frames; otherwise drop it."""
        frames, end = leading_frames(data)
        if end == len(data) and all(map(harmless, frames)):
            self._link.send(data)
        else:
            self.kept += 1

    def close(self) -> None:
        """Close the wrapped link."""
        self._link.close()


def harmless(frame: Frame) -> bool:
    """Return whether ``frame`` leaves a vehicle's behaviour unchanged."""
    if frame.message_id == mavlink.MAVLINK_MSG_ID_COMMAND_LONG:
        return command_of(frame.payload).command in REQUESTS
    return frame.message_id in _HARMLESS
