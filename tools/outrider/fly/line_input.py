"""Lines that somebody types, or that come by a pipe, without waiting for them."""

from __future__ import annotations

import os
import select
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

if sys.platform != "win32":
    import termios

_CHUNK: Final = 1024
_ERASE: Final = (b"\x7f", b"\x08")
_LONGEST: Final = 200
FEW: Final = 10
"""Lines that are handed over at once."""


class Typed:
    """``fileno``: of standard input, None without one. ``pending``: what has been typed of the next line."""

    def __init__(self, fileno: int | None) -> None:
        self._fileno = fileno
        self._line = b""
        self._complete: deque[str] = deque()

    @property
    def pending(self) -> str:
        """For whoever shows it."""
        return self._line.decode(errors="replace")

    def lines(self) -> list[str]:
        """Those that are complete; a few at a time, the next when it is asked again: who never stops writing
        takes nobody's time for anything else."""
        if not self._complete:
            self._take(self._read())
        return [self._complete.popleft() for _ in range(min(len(self._complete), FEW))]

    def _take(self, data: bytes) -> None:
        for byte in (data[k : k + 1] for k in range(len(data))):
            if byte in (b"\n", b"\r"):
                self._complete.append(self.pending)
                self._line = b""
            elif byte in _ERASE:
                self._line = self._line[:-1]
            elif byte >= b" ":
                self._line = (self._line + byte)[:_LONGEST]

    def _read(self) -> bytes:
        if self._fileno is None or not select.select([self._fileno], [], [], 0)[0]:
            return b""
        try:
            data = os.read(self._fileno, _CHUNK)
        except OSError:
            # No terminal of ours any more: nobody types.
            self._fileno = None
            return b""
        if not data:
            # Who wrote has gone, with whatever was begun. Into a named pipe another may write.
            self._line = b""
        return data


@contextmanager
def typing(shown: bool) -> Iterator[Typed]:
    """What comes by standard input. Where ``shown`` (somebody shows what is pending), a terminal hands on
    each letter and echoes none; it is as it was afterwards."""
    fileno = _standard_input()
    if fileno is None or not shown or not os.isatty(fileno):
        yield Typed(fileno)
        return
    before = termios.tcgetattr(fileno)
    now = termios.tcgetattr(fileno)
    now[3] &= ~(termios.ICANON | termios.ECHO)
    termios.tcsetattr(fileno, termios.TCSANOW, now)
    try:
        yield Typed(fileno)
    finally:
        # The terminal may be gone.
        with suppress(OSError, termios.error):
            termios.tcsetattr(fileno, termios.TCSANOW, before)


def _standard_input() -> int | None:
    """None where there is none, and in the background of a terminal, which would stop who reads it."""
    try:
        fileno = sys.stdin.fileno()
        if os.isatty(fileno) and os.tcgetpgrp(fileno) != os.getpgrp():
            return None
    except (OSError, ValueError, AttributeError):
        return None
    return fileno
