"""Demultiplexer of one physical link that several links of a node share, as behind a MAVLink router.

Received frames are distributed by their headers, and what is sent at any end leaves by the physical link.
"""

from __future__ import annotations

import select
from collections import deque
from collections.abc import Callable, Mapping
from typing import Final, Protocol

from mavlink_bridge.links.link import BURST, WAITING, Link, LinkCounters
from mavlink_bridge.wire.framing import Framer
from mavlink_bridge.wire.header import Header

Wants = Callable[[Header], bool]
ROOM: Final = 1 << 20
"""Largest number of bytes that wait at an end."""
_ROUNDS: Final = 1000
"""Number of reads after which ``forget`` ends even if data keeps arriving: more than any system buffers."""


class FrameObserver(Protocol):
    """Observer of all frames that pass a ``Demultiplexer``."""

    def said(self, data: bytes) -> None:
        """Observe frames that leave, by whichever end."""
        ...

    def received(self, header: Header, frame: bytes) -> None:
        """Observe a frame that arrives, whichever end gets it."""
        ...


class Demultiplexer:
    """Demultiplexer of ``link``: one end for each name of ``deal``.

    The function of a name in ``deal`` decides which headers its end gets. A frame goes to every end that
    wants it, and is discarded if none does. Checksums are verified, signatures are not. ``observer`` observes
    all frames.

    The ends are read by one thread at a time. The physical link is closed with the last of them.
    """

    def __init__(self, link: Link, deal: Mapping[str, Wants], observer: FrameObserver | None = None) -> None:
        self.link, self._observer = link, observer
        self.ends = {name: DemultiplexedLink(self, first=number == 0) for number, name in enumerate(deal)}
        self._deal = [(self.ends[name], wants) for name, wants in deal.items()]
        self._framer = Framer()
        self._open = len(self.ends)

    def read(self) -> None:
        """Read the physical link and distribute the frames that have arrived."""
        for datagram in self.link.receive():
            frames = [
                (Header(frame.system, frame.component, frame.message_id), frame.data)
                for frame in self._framer.feed(datagram, whole=True)
            ]
            if self._observer is not None:
                for header, data in frames:
                    self._observer.received(header, data)
            for end, wants in self._deal:
                own = [data for header, data in frames if wants(header)]
                if own:
                    end.put(b"".join(own))

    def send(self, data: bytes) -> None:
        """Send ``data`` by the physical link."""
        if self._observer is not None:
            self._observer.said(data)
        self.link.send(data)

    def forget(self) -> None:
        """Discard all that has arrived until now, at all ends.

        ``observer`` does not receive it either, because the time of its sending is unknown.
        """
        for _ in range(_ROUNDS):
            # A read that returns nothing may have accepted a TCP connection whose peer has sent already.
            if not self.link.receive() and not _readable(self.link.fileno()):
                break
        self._framer = Framer()
        for end in self.ends.values():
            end.clear()

    def leave(self) -> None:
        """Record that one end is closed; close the physical link with the last one."""
        self._open -= 1
        if not self._open:
            self.link.close()


def _readable(fileno: int | None) -> bool:
    """Return whether ``fileno`` is ready to be read."""
    return fileno is not None and bool(select.select([fileno], [], [], 0)[0])


class DemultiplexedLink:
    """One end of a ``Demultiplexer``: a ``Link``; if it is not read, the oldest data is dropped."""

    def __init__(self, demultiplexer: Demultiplexer, *, first: bool) -> None:
        self._demultiplexer, self._first = demultiplexer, first
        self._waiting: deque[bytes] = deque()
        self._bytes = 0
        self._received = self._sent = 0
        self._open = True

    @property
    def counters(self) -> LinkCounters:
        """Counts of this end; ``dropped`` is that of the physical link, for all its ends."""
        return LinkCounters(self._received, self._sent, self._demultiplexer.link.counters.dropped)

    def fileno(self) -> int | None:
        """Return that of the physical link for the first end, None for the others."""
        return self._demultiplexer.link.fileno() if self._first else None

    def put(self, data: bytes) -> None:
        """Add some frames for this end."""
        if not self._open:
            return
        self._waiting.append(data)
        self._bytes += len(data)
        while self._bytes > ROOM or len(self._waiting) > WAITING:
            self._bytes -= len(self._waiting.popleft())

    def clear(self) -> None:
        """Discard what waits."""
        self._waiting.clear()
        self._bytes = 0

    def receive(self) -> list[bytes]:
        """Return the frames that were distributed to this end."""
        if not self._open:
            return []
        self._demultiplexer.read()
        found = [self._waiting.popleft() for _ in range(min(len(self._waiting), BURST))]
        self._bytes -= sum(map(len, found))
        self._received += len(found)
        return found

    def send(self, data: bytes) -> None:
        """Send ``data`` by the physical link."""
        if self._open:
            self._sent += 1
            self._demultiplexer.send(data)

    def close(self) -> None:
        """Close this end."""
        if self._open:
            self._open = False
            self.clear()
            self._demultiplexer.leave()
