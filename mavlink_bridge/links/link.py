"""Interface of every link: transfer of datagrams between this process and others, without waiting.

A link does not interpret the data. If the sender passes complete MAVLink frames, the receiver gets complete
frames, even if the transport is a stream that cuts them anywhere.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple, Protocol

BURST = 1024
"""Largest number of datagrams of one ``receive``: a flood must not occupy its reader for ever."""
WAITING = 4096
"""Largest number of datagrams that wait at the end of a link within this process."""


class LinkCounters(NamedTuple):
    """Counters of a link.

    ``received`` and ``sent`` datagrams; ``dropped``: datagrams to send that no peer could take.
    """

    received: int
    sent: int
    dropped: int


class Link(Protocol):
    """One open end of a link.

    One thread at a time may call ``receive``, and one, the same or another, ``send``.

    Neither call waits or raises an error of the transport. A lost peer, an unplugged cable or a full buffer
    shows in the counters, and the link recovers by itself where that is possible.
    """

    @property
    def counters(self) -> LinkCounters:
        """Counters since the link was opened."""
        ...

    def fileno(self) -> int | None:
        """Return the file descriptor to wait for, or None if there is none and the link must be polled.

        When it is readable, ``receive`` has something to do. It stays the same as long as the link is open;
        only ``SerialPort.let_go`` replaces it. A link that has lost its peer tries to reconnect in
        ``receive``, so call ``receive`` periodically as well.
        """
        ...

    def receive(self) -> list[bytes]:
        """Return datagrams that have arrived, in order for each peer, at most ``BURST``; the rest waits."""
        ...

    def send(self, data: bytes) -> None:
        """Send ``data`` (one or more complete frames) if that is possible at once."""
        ...

    def close(self) -> None:
        """Release all resources; calling it again is harmless.

        Afterwards nothing arrives and nothing leaves.
        """
        ...


def failure_of(link: Link) -> str:
    """Return why ``link`` has no peer, in the system's words; empty if it has one, or if unknown."""
    return str(getattr(link, "failure", ""))


class MemoryLink:
    """One of two connected ends within a process, see ``memory_pair``; a full end drops its oldest data."""

    def __init__(self, ours: deque[bytes], theirs: deque[bytes]) -> None:
        self._ours, self._theirs = ours, theirs
        self._received = self._sent = 0
        self._open = True

    @property
    def counters(self) -> LinkCounters:
        """Counts; ``dropped`` is always 0, because the receiving end drops."""
        return LinkCounters(self._received, self._sent, 0)

    def fileno(self) -> None:
        """Return None: the link must be polled."""

    def receive(self) -> list[bytes]:
        """Return what the other end has sent."""
        # Only this end removes datagrams, so at least the counted number is present.
        found = [self._ours.popleft() for _ in range(min(len(self._ours), BURST))] if self._open else []
        self._received += len(found)
        return found

    def send(self, data: bytes) -> None:
        """Pass ``data`` to the other end."""
        if self._open:
            self._theirs.append(data)
            self._sent += 1

    def close(self) -> None:
        """Close this end; the other may still receive what was sent."""
        self._open = False


def memory_pair() -> tuple[MemoryLink, MemoryLink]:
    """Return two connected ends: what is sent at one arrives at the other."""
    there: deque[bytes] = deque(maxlen=WAITING)
    back: deque[bytes] = deque(maxlen=WAITING)
    return MemoryLink(there, back), MemoryLink(back, there)
