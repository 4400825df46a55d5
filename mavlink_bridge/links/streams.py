"""Common base of links over byte streams: several streams, one file descriptor to wait for, reconnection."""

from __future__ import annotations

import selectors
from threading import Lock
from typing import Any, Final

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.links.link import LinkCounters
from mavlink_bridge.links.stream import Stream
from mavlink_bridge.wire.framing import leading_frames

RETRY: Final = 1_000_000
"""µs between two attempts to reconnect."""
HUNG: Final = 30_000_000
"""µs after which a peer that takes no data is disconnected; otherwise it would occupy its place for ever."""
MOST_FRAMES: Final = 16
"""Largest number of frames in one datagram that is read from a stream.

A receiver bounds its work by the datagram. A UDP datagram holds what its sender put together; what a read of
a stream happens to hold must not be too much.
"""
_SLOW_READER: Final = 500_000
"""µs between reads from a peer that does not take what is sent: its orders must still get through."""
_MAX_READ_BYTES: Final = 16384
"""Bytes after which one ``receive`` reads no further stream: many full streams would take long to parse."""


class StreamLink:
    """Link over any number of streams.

    A stream that breaks or hangs is closed. While none is open, ``_reopen`` is called at most once a second,
    by ``receive`` and ``send``.

    A lock protects the streams, because two threads may use a link; its holder never blocks.
    """

    _waits_for_readers = False
    """Whether little is read from a peer while half of what may wait for it waits: twice a second."""

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
        """Counts of datagrams.

        A datagram counts as sent if at least one peer takes it. The frames of one read count as one received
        datagram, or as several of ``MOST_FRAMES`` frames.
        """
        return LinkCounters(self._received, self._sent, self._dropped)

    @property
    def peers(self) -> int:
        """Number of open streams."""
        return len(self._streams)

    def fileno(self) -> int | None:
        """Return the file descriptor of the selector over all streams; None where the system has none."""
        return self._fileno

    def receive(self) -> list[bytes]:
        """Return what has arrived, up to about 24 KiB; also continue pending connections and writes."""
        with self._lock:
            found: list[bytes] = []
            if not self._open:
                return found
            self._recover()
            size = 0
            for stream in self._ready():
                if not isinstance(stream, Stream):
                    self._attend(stream)
                elif size < _MAX_READ_BYTES:
                    size += self._serve(stream, found)
            self._received += len(found)
            return found

    def send(self, data: bytes) -> None:
        """Write ``data`` to every stream that accepts all of it."""
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

    def take_over(self) -> None:
        """Use the streams in a forked process, beside the process that it was forked from.

        The selector is replaced: a forked process shares it, and would change that of the other.
        """
        with self._lock:
            if not self._open:
                return
            self._selector.close()
            self._selector = selectors.DefaultSelector()
            self._fileno = _number(self._selector)
            for stream in self._streams:
                self._selector.register(stream, selectors.EVENT_READ)
            self._register()

    def release_broken(self) -> None:
        """Close streams whose other side is gone; for a process that keeps them open and does not read."""
        with self._lock:
            for stream in tuple(self._streams):
                if stream.hung_up:
                    self._selector.unregister(stream)
                    self._streams.remove(stream)
                    stream.close()

    # For subclasses.

    def _register(self) -> None:
        """Register in a new selector what is not a stream."""

    def _forget(self) -> None:
        """Close this process's descriptors of all streams, and discard the data that waits for them.

        The selector is replaced and not modified, because a forked process shares it.
        """
        if not self._open:
            return
        for stream in self._streams:
            stream.close()
        self._streams.clear()
        self._selector.close()
        self._selector = selectors.DefaultSelector()
        self._fileno = _number(self._selector)

    def _adopt(self, fileno: int) -> None:
        """Add a stream."""
        stream = Stream(fileno, self._backlog)
        self._streams.append(stream)
        self._selector.register(stream, selectors.EVENT_READ)

    def _reopen(self, now: int) -> None:
        """Open a stream, or begin to; called at ``now`` (µs) when none is open."""

    def _attend(self, ready: Any) -> None:
        """Handle ``ready``, which is registered in the selector and is not a stream."""

    def _release(self) -> None:
        """Close what is not a stream."""

    # For this class alone.

    def _recover(self) -> None:
        if self._streams:
            return
        now = self._clock.now()
        if now >= self._next_attempt:
            self._next_attempt = now + RETRY
            self._reopen(now)

    def _ready(self) -> list[Any]:
        """Return the ready objects, in an order that rotates from call to call."""
        ready = [key.fileobj for key, _ in self._selector.select(0)]
        self._turn = turn = (self._turn + 1) % max(len(ready), 1)
        return ready[turn:] + ready[:turn]

    def _serve(self, stream: Stream, found: list[bytes]) -> int:
        """Read ``stream`` once, so that a busy sender does not delay others; return the number of bytes."""
        stream.flush()
        data = None
        now = self._clock.now()
        if not (self._waits_for_readers and stream.backed_up and now - stream.read_at < _SLOW_READER):
            stream.read_at = now
            data = stream.read()
        if data:
            found += _pieces(data)
        stream.flush()
        self._settle(stream)
        return len(data or b"")

    def _settle(self, stream: Stream) -> None:
        """Select for what will be done next; close and remove a stream that is broken or hung."""
        if not stream.alive or (stream.waits and stream.stuck(self._clock.now()) > HUNG):
            self._selector.unregister(stream)
            self._streams.remove(stream)
            stream.close()
            return
        read = 0 if self._waits_for_readers and stream.backed_up else selectors.EVENT_READ
        events = read | (selectors.EVENT_WRITE if stream.waits else 0)
        if self._selector.get_key(stream).events != events:
            self._selector.modify(stream, events)


def _pieces(data: bytes) -> list[bytes]:
    """Return ``data``, as far as it is undamaged in pieces of at most ``MOST_FRAMES`` frames."""
    frames, _ = leading_frames(data)
    if len(frames) <= MOST_FRAMES:
        return [data]
    pieces, at = [], 0
    for first in range(0, len(frames), MOST_FRAMES):
        begin, at = at, at + sum(len(frame.data) for frame in frames[first : first + MOST_FRAMES])
        pieces.append(data[begin:at])
    return [*pieces, data[at:]] if at < len(data) else pieces


def _number(selector: selectors.BaseSelector) -> int | None:
    fileno = getattr(selector, "fileno", None)
    return None if fileno is None else int(fileno())
