"""Demultiplexer of one physical link that several links of a node share, as behind a MAVLink router.

Received frames are distributed by their headers; data sent at any end leaves by the physical link.
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
"""Predicate: whether an end receives frames with this header."""
ROOM: Final = 1 << 20
"""Largest number of bytes that wait at an end."""
_MAX_FORGET_READS: Final = 1000
"""Largest number of reads of ``forget``, in case data keeps arriving: more than any system buffers."""


class FrameObserver(Protocol):
    """Observer of all frames that pass a ``Demultiplexer``."""

    def said(self, data: bytes) -> None:
        """Observe frames that leave by any end."""
        ...

    def received(self, header: Header, frame: bytes) -> None:
        """Observe a frame that arrives, for any end or none."""
        ...


class Demultiplexer:
    """Demultiplexer of ``link``: one end for each name of ``deal``.

    ``deal`` maps the name of an end to a predicate. A frame goes to every end whose predicate is true of its
    header, and is discarded if there is none. Frames with a wrong checksum or of a message that the dialect
    lacks are discarded, too; signatures are not verified. ``observer`` observes all sent data and all
    received frames with a valid checksum and a known message, also those that no end receives.

    Only one thread at a time may read the ends. Closing the last end closes the physical link.
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
        """Discard all data that has arrived until now, at all ends.

        ``observer`` does not receive these frames either, because the time of their sending is unknown.
        """
        for _ in range(_MAX_FORGET_READS):
            # A read that returns nothing may have accepted a TCP connection on which data waits already.
            if not self.link.receive() and not _readable(self.link.fileno()):
                break
        self._framer = Framer()
        for end in self.ends.values():
            end.clear()

    def leave(self) -> None:
        """Record that one end is closed; close the physical link if it was the last one."""
        self._open -= 1
        if not self._open:
            self.link.close()


def _readable(fileno: int | None) -> bool:
    """Return whether ``fileno`` is ready to be read."""
    return fileno is not None and bool(select.select([fileno], [], [], 0)[0])


class DemultiplexedLink:
    """One end of a ``Demultiplexer``, a ``Link``; while it is not read, the oldest data is dropped."""

    def __init__(self, demultiplexer: Demultiplexer, *, first: bool) -> None:
        self._demultiplexer, self._first = demultiplexer, first
        self._waiting: deque[bytes] = deque()
        self._bytes = 0
        self._received = self._sent = 0
        self._open = True

    @property
    def counters(self) -> LinkCounters:
        """Counts of this end; ``dropped`` is the count of the physical link, for all ends."""
        return LinkCounters(self._received, self._sent, self._demultiplexer.link.counters.dropped)

    def fileno(self) -> int | None:
        """Return the file descriptor of the physical link for the first end, None for the others."""
        return self._demultiplexer.link.fileno() if self._first else None

    def put(self, data: bytes) -> None:
        """Queue ``data`` (complete frames) for this end; above the limits drop the oldest data."""
        if not self._open:
            return
        self._waiting.append(data)
        self._bytes += len(data)
        while self._bytes > ROOM or len(self._waiting) > WAITING:
            self._bytes -= len(self._waiting.popleft())

    def clear(self) -> None:
        """Discard the data that waits."""
        self._waiting.clear()
        self._bytes = 0

    def receive(self) -> list[bytes]:
        """Read the physical link and return the frames for this end, at most ``BURST`` datagrams."""
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
