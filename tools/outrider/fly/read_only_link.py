"""A link over which nothing passes that changes what anybody does: the last door of a dry run."""

from __future__ import annotations

from struct import Struct
from typing import Final

from companion.dry_run import REQUESTS
from mavlink_bridge.links.link import Link, LinkCounters
from mavlink_bridge.wire.framing import Frame, leading_frames

_COMMAND_LONG: Final = 76
_COMMAND: Final = Struct("<28xH")
_TELL: Final = frozenset((0, 20, 111, 251, 253))
"""HEARTBEAT, PARAM_REQUEST_READ, TIMESYNC, NAMED_VALUE_FLOAT, STATUSTEXT."""


class HarmlessLink:
    """``link``, outwards for what only tells, and for requests for messages, parameters and the time.
    ``kept``: datagrams kept back."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self.kept = 0

    @property
    def counters(self) -> LinkCounters:
        """The link's."""
        return self._link.counters

    def fileno(self) -> int | None:
        """The link's."""
        return self._link.fileno()

    def receive(self) -> list[bytes]:
        """The link's."""
        return self._link.receive()

    def send(self, data: bytes) -> None:
        """If all of it is harmless."""
        frames, end = leading_frames(data)
        if end == len(data) and all(map(harmless, frames)):
            self._link.send(data)
        else:
            self.kept += 1

    def close(self) -> None:
        """The link."""
        self._link.close()


def harmless(frame: Frame) -> bool:
    """Whether it changes nothing of what a vehicle does."""
    if frame.message_id == _COMMAND_LONG:
        (command,) = _COMMAND.unpack_from(frame.payload.ljust(_COMMAND.size, b"\0"))
        return command in REQUESTS
    return frame.message_id in _TELL
