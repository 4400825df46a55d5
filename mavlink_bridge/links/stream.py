"""Non-blocking byte stream: input is assembled into whole frames, and output is never cut within a frame."""

from __future__ import annotations

import os
import select
from typing import Final

from mavlink_bridge.wire.framing import Framer

_CHUNK: Final = 8192


class Assembler:
    """Assembler that holds back the beginning of a frame until its rest has arrived.

    All other bytes, garbage included, are passed on at once, so that the decoder can count them. A frame of
    an unknown message is held back until the byte after it arrives. Garbage that looks like the start of a
    frame is also held back, until as many bytes as its header claims have arrived.
    """

    def __init__(self) -> None:
        self._framer = Framer()
        self._rest = b""

    def feed(self, data: bytes) -> bytes:
        """Return the complete part of earlier input and ``data``; it may be empty."""
        self._framer.feed(data)
        data = self._rest + data
        whole = len(data) - self._framer.pending_bytes
        self._rest = data[whole:]
        return data[:whole]


class Stream:
    """Non-blocking stream over a file descriptor, which it owns.

    If the other side is slow, up to ``backlog`` bytes wait (or one longer datagram). Further datagrams are
    refused as a whole, which bounds the delay.
    """

    def __init__(self, fileno: int, backlog: int) -> None:
        os.set_blocking(fileno, False)
        self._fileno = fileno
        self._backlog = backlog
        self._assembler = Assembler()
        self._waiting = b""
        self._stuck_at: int | None = None
        self.read_at = 0
        """Time (µs) of the last read, for the owner."""
        self.alive = True
        """False after the other side has closed or an error; then only ``close`` is useful."""

    @property
    def waits(self) -> bool:
        """Whether data waits to be written as soon as there is room."""
        return bool(self._waiting)

    @property
    def backed_up(self) -> bool:
        """Whether half of what may wait for the other side waits."""
        return 2 * len(self._waiting) > self._backlog

    @property
    def hung_up(self) -> bool:
        """Whether the other side is gone: the connection was closed, or the port unplugged."""
        poll = select.poll()
        poll.register(self._fileno, 0)
        return any(event & (select.POLLHUP | select.POLLERR) for _, event in poll.poll(0))

    def fileno(self) -> int:
        """Return the file descriptor, open until ``close``."""
        return self._fileno

    def read(self) -> bytes | None:
        """Return the complete frames of one read of 8 KiB at most; None if nothing could be read.

        The result is empty if only a part of a frame has arrived.
        """
        try:
            data = os.read(self._fileno, _CHUNK)
        except BlockingIOError:
            return None
        except OSError:
            data = b""
        if not data:
            self.alive = False
            return None
        return self._assembler.feed(data)

    def stuck(self, now: int) -> int:
        """Return for how long (µs) the other side has taken none of the waiting data; 0 if none waits.

        The time counts from the first call of ``stuck`` after the last successful write.
        """
        if not self._waiting:
            return 0
        if self._stuck_at is None:
            self._stuck_at = now
        return now - self._stuck_at

    def write(self, data: bytes) -> bool:
        """Write or queue all of ``data`` and return True, or return False if all of it is refused."""
        self.flush()
        if not self.alive or (self._waiting and len(self._waiting) + len(data) > self._backlog):
            return False
        self._waiting += data
        self.flush()
        return True

    def flush(self) -> None:
        """Write as much of the waiting data as the system accepts."""
        try:
            while self._waiting:
                self._waiting = self._waiting[os.write(self._fileno, self._waiting) :]
                self._stuck_at = None
        except BlockingIOError:
            pass
        except OSError:
            self.alive = False
            self._waiting = b""

    def close(self) -> None:
        """Close the file descriptor; call this once."""
        os.close(self._fileno)
