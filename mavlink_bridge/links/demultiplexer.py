"""One physical link that several links of a node share, as behind a MAVLink router: frames are dealt out by
their headers, and what is sent at any end goes the same way."""

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
"""Bytes that wait at an end at most."""
_ROUNDS: Final = 1000
"""Reads after which no more is forgotten, of somebody who never stops: more than any system keeps."""


class Ear(Protocol):
    """Who listens to all that passes a ``Dealer``."""

    def said(self, data: bytes) -> None:
        """Frames that leave, by whichever end."""
        ...

    def heard(self, header: Header, frame: bytes) -> None:
        """A frame that arrives, whoever gets it."""
        ...


class Dealer:
    """``ends``: a link for each name of ``deal``, which says which headers it gets; a frame goes to every end
    that wants it, and to none if nobody does. Checksums are looked at, signatures are not. ``ear`` hears all.

    Its ends are read by one thread at a time. The physical link is closed with the last of them.
    """

    def __init__(self, link: Link, deal: Mapping[str, Wants], ear: Ear | None = None) -> None:
        self.link, self._ear = link, ear
        self.ends = {name: DealtLink(self, first=number == 0) for number, name in enumerate(deal)}
        self._deal = [(self.ends[name], wants) for name, wants in deal.items()]
        self._framer = Framer()
        self._open = len(self.ends)

    def read(self) -> None:
        """Deal out what has arrived."""
        for datagram in self.link.receive():
            frames = [
                (Header(frame.system, frame.component, frame.message_id), frame.data)
                for frame in self._framer.feed(datagram, whole=True)
            ]
            if self._ear is not None:
                for header, data in frames:
                    self._ear.heard(header, data)
            for end, wants in self._deal:
                own = [data for header, data in frames if wants(header)]
                if own:
                    end.put(b"".join(own))

    def send(self, data: bytes) -> None:
        """By the physical link."""
        if self._ear is not None:
            self._ear.said(data)
        self.link.send(data)

    def forget(self) -> None:
        """What has arrived until now, at all ends; ``ear`` does not hear it either, as nobody knows when it
        was said."""
        for _ in range(_ROUNDS):
            # One that brings nothing may have answered a call, of somebody who has spoken already.
            if not self.link.receive() and not _readable(self.link.fileno()):
                break
        self._framer = Framer()
        for end in self.ends.values():
            end.clear()

    def leave(self) -> None:
        """One end is closed."""
        self._open -= 1
        if not self._open:
            self.link.close()


def _readable(fileno: int | None) -> bool:
    """Whether there is something to do for who waits for it."""
    return fileno is not None and bool(select.select([fileno], [], [], 0)[0])


class DealtLink:
    """One end of a ``Dealer``: a ``Link``. If nobody takes what waits, the oldest gives way."""

    def __init__(self, dealer: Dealer, *, first: bool) -> None:
        self._dealer, self._first = dealer, first
        self._waiting: deque[bytes] = deque()
        self._bytes = 0
        self._received = self._sent = 0
        self._open = True

    @property
    def counters(self) -> LinkCounters:
        """Its own; ``dropped`` is that of the physical link, for all its ends."""
        return LinkCounters(self._received, self._sent, self._dealer.link.counters.dropped)

    def fileno(self) -> int | None:
        """That of the physical link, for one of its ends."""
        return self._dealer.link.fileno() if self._first else None

    def put(self, data: bytes) -> None:
        """Some frames for this end."""
        if not self._open:
            return
        self._waiting.append(data)
        self._bytes += len(data)
        while self._bytes > ROOM or len(self._waiting) > WAITING:
            self._bytes -= len(self._waiting.popleft())

    def clear(self) -> None:
        """Forget what waits."""
        self._waiting.clear()
        self._bytes = 0

    def receive(self) -> list[bytes]:
        """What has been dealt to it."""
        if not self._open:
            return []
        self._dealer.read()
        found = [self._waiting.popleft() for _ in range(min(len(self._waiting), BURST))]
        self._bytes -= sum(map(len, found))
        self._received += len(found)
        return found

    def send(self, data: bytes) -> None:
        """By the physical link."""
        if self._open:
            self._sent += 1
            self._dealer.send(data)

    def close(self) -> None:
        """This end."""
        if self._open:
            self._open = False
            self.clear()
            self._dealer.leave()
