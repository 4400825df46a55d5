"""What every link can do: a way for datagrams between this process and others, that never waits.

A link has no opinion on what passes through it; it gives up whole MAVLink frames if whole frames went in,
also where the transport below is a stream that cuts them anywhere.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple, Protocol

BURST = 1024
"""Datagrams that one ``receive`` hands over at most: a flood must not keep its reader for ever."""
WAITING = 4096
"""Datagrams that wait in a MemoryLink at most."""


class LinkCounters(NamedTuple):
    """``received`` and ``sent`` datagrams; ``dropped``: of those to send, that nobody could take."""

    received: int
    sent: int
    dropped: int


class Link(Protocol):
    """One open end. ``receive`` and ``send`` may be called by two different threads, each by one at a time.

    Neither waits, and neither raises for trouble on the way: a peer that is gone, a cable that is out, a
    buffer that is full show in the counters, and the link recovers by itself where that is possible.
    """

    @property
    def counters(self) -> LinkCounters:
        """The counts since it was opened."""
        ...

    def fileno(self) -> int | None:
        """What to wait for (readable: ``receive`` has something to do), the same as long as the link is open;
        None: there is nothing to wait for, ask from time to time.

        A link that has lost its peer tries to find it again when it is asked, so ask also without cause.
        """
        ...

    def receive(self) -> list[bytes]:
        """All that has arrived, oldest first, but no more than BURST; empty when there is nothing."""
        ...

    def send(self, data: bytes) -> None:
        """Pass on ``data``, some whole frames, if it is possible at once."""
        ...

    def close(self) -> None:
        """Give everything back; again is harmless. Afterwards nothing arrives and nothing leaves."""
        ...


class MemoryLink:
    """One of two ends within a process; see ``memory_pair``. At a full end the oldest give way."""

    def __init__(self, ours: deque[bytes], theirs: deque[bytes]) -> None:
        self._ours, self._theirs = ours, theirs
        self._received = self._sent = 0
        self._open = True

    @property
    def counters(self) -> LinkCounters:
        """None is dropped by the sender."""
        return LinkCounters(self._received, self._sent, 0)

    def fileno(self) -> None:
        """Nothing to wait for."""

    def receive(self) -> list[bytes]:
        """What the other end has sent."""
        # Only this end takes out, so that what has been counted is there.
        found = [self._ours.popleft() for _ in range(min(len(self._ours), BURST))] if self._open else []
        self._received += len(found)
        return found

    def send(self, data: bytes) -> None:
        """Put it where the other end finds it."""
        if self._open:
            self._theirs.append(data)
            self._sent += 1

    def close(self) -> None:
        """This end; the other may still take what was sent."""
        self._open = False


def memory_pair() -> tuple[MemoryLink, MemoryLink]:
    """Two ends: what is sent at one arrives at the other."""
    there: deque[bytes] = deque(maxlen=WAITING)
    back: deque[bytes] = deque(maxlen=WAITING)
    return MemoryLink(there, back), MemoryLink(back, there)
