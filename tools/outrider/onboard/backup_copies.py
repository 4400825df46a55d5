"""Copies of what a companion sends and hears, for its backup node in another process.

In each step the companion's process sends one record over a local socket, before its messages leave: the
newest signing stamp, what it heard of its autopilot, and what it is about to send. The socket is private, so
the copies are trusted and their signatures are not checked again.
"""

from __future__ import annotations

import socket
from struct import Struct
from struct import error as StructError  # noqa: N812
from typing import Final, NamedTuple

from mavlink_bridge.links.link import LinkCounters

_HEADER: Final = Struct("<QQ?HHHH")
_MAX_RECORD_BYTES: Final = 65536
_BUFFER_BYTES: Final = 1 << 20


class Copies(NamedTuple):
    """Record of the step at ``time`` (µs).

    ``stamp``: the companion's newest signing stamp (10 µs since 2015). ``vehicle``: frames of the autopilot,
    without signatures. ``autopilot``, ``swarm``: frames that the companion sends on these links. ``heard``:
    what arrived on the swarm link, as it is, only for the log. ``holds``: the companion flies no more and
    requests the hold itself.
    """

    time: int = 0
    stamp: int = 0
    vehicle: bytes = b""
    autopilot: bytes = b""
    swarm: bytes = b""
    heard: bytes = b""
    holds: bool = False

    def pack(self) -> bytes:
        """Return the record as bytes. Raises ValueError for a part that is too long."""
        parts = self.vehicle, self.autopilot, self.swarm, self.heard
        try:
            return _HEADER.pack(self.time, self.stamp, self.holds, *map(len, parts)) + b"".join(parts)
        except StructError as error:
            raise ValueError(f"a record does not fit: {error}") from None


def unpack(data: bytes) -> Copies:
    """Return the record of ``data``, as ``Copies.pack`` has made it."""
    time, stamp, holds, *sizes = _HEADER.unpack_from(data)
    parts, at = [], _HEADER.size
    for size in sizes:
        parts.append(data[at : at + size])
        at += size
    vehicle, autopilot, swarm, heard = parts
    return Copies(time, stamp, vehicle, autopilot, swarm, heard, holds)


def copies_pair() -> tuple[CopySender, CopyLink]:
    """Return both ends of a new socket: the companion's and the backup node's.

    Records are kept apart, and the end of all processes with the companion's end shows at the other one.
    """
    sender, receiver = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in (sender, receiver):
        end.setblocking(False)
    sender.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
    return CopySender(sender), CopyLink(receiver)


class CopySender:
    """The companion's end."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end

    def send(self, copies: Copies) -> None:
        """Send a record; it is lost if the backup node does not read, or has ended."""
        try:
            self._end.send(copies.pack())
        except (OSError, ValueError):
            return

    def close(self) -> None:
        """Close this end in this process."""
        self._end.close()


class CopyLink:
    """The backup node's end, a ``Link`` that only receives.

    ``ended``: whether no process has the companion's end open any more.
    """

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self._received = 0
        self.ended = False

    @property
    def counters(self) -> LinkCounters:
        """Link counters: the number of received records, and zeros."""
        return LinkCounters(self._received, 0, 0)

    def fileno(self) -> None:
        """Return None: the link is read in each step."""

    def receive(self) -> list[bytes]:
        """Return all records that have arrived; the socket's buffer bounds their number.

        With a part of them the companion would count as silent.
        """
        found: list[bytes] = []
        while not self.ended:
            try:
                data = self._end.recv(_MAX_RECORD_BYTES)
            except BlockingIOError:
                break
            except OSError:
                data = b""
            if data:
                found.append(data)
            else:
                self.ended = True
        self._received += len(found)
        return found

    def send(self, data: bytes) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Close this end in this process."""
        self._end.close()
