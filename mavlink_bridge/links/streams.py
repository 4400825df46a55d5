"""What links over byte streams have in common: some streams, one thing to wait for, and coming back."""

from __future__ import annotations

import selectors
from threading import Lock
from typing import Any, Final

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.links.link import LinkCounters
from mavlink_bridge.links.stream import Stream

RETRY: Final = 1_000_000
"""µs between two attempts to get a lost connection back."""
HUNG: Final = 30_000_000
"""µs after which a peer that takes nothing of what waits for it is given up: it would hold its place for
ever."""
_ENOUGH: Final = 16384
# Bytes of all streams that are taken in at once: there may be many, full of what takes long to look at.


class StreamLink:
    """A link over any number of streams. A stream that breaks or hangs is dropped, and if none is left,
    ``_reopen`` is called once a second.

    The two threads that may use a link share its streams, hence the lock; nothing within it waits.
    """

    def __init__(self, clock: Clock, backlog: int) -> None:
        # The selector's own file descriptor stays the same while streams come and go.
        self._selector = selectors.DefaultSelector()
        self._lock = Lock()
        self._clock = clock
        self._backlog = backlog
        self._streams: list[Stream] = []
        self._received = self._sent = self._dropped = self._turn = 0
        self._next_attempt = clock.now()
        self._open = True
        self._fileno = _number(self._selector)

    @property
    def counters(self) -> LinkCounters:
        """A datagram that one of several peers takes is sent; on a stream, what is read at once is one."""
        return LinkCounters(self._received, self._sent, self._dropped)

    @property
    def peers(self) -> int:
        """How many streams are open."""
        return len(self._streams)

    def fileno(self) -> int | None:
        """The selector over all streams, where the system has such a thing."""
        return self._fileno

    def receive(self) -> list[bytes]:
        """What has arrived on all streams; also goes on with what is under way: calls, writing."""
        with self._lock:
            found: list[bytes] = []
            if not self._open:
                return found
            self._recover()
            size = 0
            for stream in self._ready():
                if not isinstance(stream, Stream):
                    self._attend(stream)
                elif size < _ENOUGH:
                    size += self._serve(stream, found)
            self._received += len(found)
            return found

    def send(self, data: bytes) -> None:
        """Write ``data`` to all streams that have room for all of it."""
        with self._lock:
            taken = False
            if self._open:
                self._recover()
                for stream in tuple(self._streams):
                    taken |= stream.write(data)
                    self._settle(stream)
            if taken:
                self._sent += 1
            else:
                self._dropped += 1

    def close(self) -> None:
        """Close all streams; what still waits to be written is lost."""
        with self._lock:
            if not self._open:
                return
            self._open = False
            for stream in self._streams:
                stream.close()
            self._streams.clear()
            self._release()
            self._selector.close()

    # For the kinds of links

    def _forget(self) -> None:
        """Close this process's copies of all streams, and of what waits for them: the selector of the other
        process, which is the same to the system, stays as it is."""
        if not self._open:
            return
        for stream in self._streams:
            stream.close()
        self._streams.clear()
        self._selector.close()
        self._selector = selectors.DefaultSelector()
        self._fileno = _number(self._selector)

    def _adopt(self, fileno: int) -> None:
        """One more stream."""
        stream = Stream(fileno, self._backlog)
        self._streams.append(stream)
        self._selector.register(stream, selectors.EVENT_READ)

    def _reopen(self, now: int) -> None:
        """No stream is left at ``now`` (µs): get one, or at least begin to."""

    def _attend(self, ready: Any) -> None:
        """``ready`` is registered in the selector and no stream."""

    def _release(self) -> None:
        """Close what is not a stream."""

    # Own

    def _recover(self) -> None:
        if self._streams:
            return
        now = self._clock.now()
        if now >= self._next_attempt:
            self._next_attempt = now + RETRY
            self._reopen(now)

    def _ready(self) -> list[Any]:
        """What there is to do, each time beginning with another one."""
        ready = [key.fileobj for key, _ in self._selector.select(0)]
        self._turn = turn = (self._turn + 1) % max(len(ready), 1)
        return ready[turn:] + ready[:turn]

    def _serve(self, stream: Stream, found: list[bytes]) -> int:
        """Read a little, so that who says most is not all that is heard, and the rest the next time. How much
        it was."""
        data = stream.read()
        if data:
            found.append(data)
        stream.flush()
        self._settle(stream)
        return len(data or b"")

    def _settle(self, stream: Stream) -> None:
        """Watch for room only while something waits for it; drop what is broken or hangs."""
        if not stream.alive or (stream.waits and stream.stuck(self._clock.now()) > HUNG):
            self._selector.unregister(stream)
            self._streams.remove(stream)
            stream.close()
            return
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if stream.waits else 0)
        if self._selector.get_key(stream).events != events:
            self._selector.modify(stream, events)


def _number(selector: selectors.BaseSelector) -> int | None:
    fileno = getattr(selector, "fileno", None)
    return None if fileno is None else int(fileno())
