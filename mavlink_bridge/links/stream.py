"""One byte stream, without waiting: frames are put together on the way in, and never cut on the way out."""

from __future__ import annotations

import os
from typing import Final

from mavlink_bridge.wire.framing import Framer

_CHUNK: Final = 8192


class Assembler:
    """Holds back the beginning of a frame until its rest is there. Nothing is lost: all other bytes, garbage
    too, are handed on at once, so that whoever decodes counts them. (Garbage that looks like a start makes
    the decoder wait for the next piece at times; whole frames alone never do.)"""

    def __init__(self) -> None:
        self._framer = Framer()
        self._rest = b""

    def feed(self, data: bytes) -> bytes:
        """What is complete of what came before and ``data``; may be empty."""
        self._framer.feed(data)
        data = self._rest + data
        whole = len(data) - self._framer.pending_bytes
        self._rest = data[whole:]
        return data[:whole]


class Stream:
    """A file descriptor, which becomes this object's own. When the other side is slow, ``backlog`` bytes wait
    (or one datagram that is longer); beyond, whole datagrams are refused: what is late is worth less than
    what comes next."""

    def __init__(self, fileno: int, backlog: int) -> None:
        os.set_blocking(fileno, False)
        self._fileno = fileno
        self._backlog = backlog
        self._assembler = Assembler()
        self._waiting = b""
        self._stuck_at: int | None = None
        self.alive = True
        """False once the other side is gone; then only ``close`` makes sense."""

    @property
    def waits(self) -> bool:
        """Whether something is left to be written as soon as there is room."""
        return bool(self._waiting)

    def fileno(self) -> int:
        """The file descriptor, open until ``close``."""
        return self._fileno

    def read(self) -> bytes | None:
        """What has arrived, in whole frames as far as it is frames, about 8 KiB at most; None if there is
        nothing."""
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
        """For how long (µs) something has been waiting of which the other side took nothing, at ``now``."""
        if not self._waiting:
            return 0
        if self._stuck_at is None:
            self._stuck_at = now
        return now - self._stuck_at

    def write(self, data: bytes) -> bool:
        """False if ``data`` was refused; then none of it has been or will be written."""
        self.flush()
        if not self.alive or (self._waiting and len(self._waiting) + len(data) > self._backlog):
            return False
        self._waiting += data
        self.flush()
        return True

    def flush(self) -> None:
        """Write of what waits as much as there is room for."""
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
        """Give the file descriptor back; once."""
        os.close(self._fileno)
