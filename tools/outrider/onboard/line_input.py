"""Lines from a terminal or a pipe, read without blocking."""

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

_CHUNK_BYTES: Final = 1024
_ERASE: Final = (b"\x7f", b"\x08")
_MAX_LINE_BYTES: Final = 200
FEW: Final = 10
"""Maximum number of lines returned at once."""


class LineInput:
    """Lines of an input; ``fileno``: its file descriptor, None if there is no input."""

    def __init__(self, fileno: int | None) -> None:
        self._fileno = fileno
        self._line = b""
        self._complete: deque[str] = deque()

    @property
    def pending(self) -> str:
        """Incomplete next line, for display."""
        return self._line.decode(errors="replace")

    def lines(self) -> list[str]:
        """Return complete lines, at most ``FEW``; the next calls return the rest.

        The limit keeps an endless writer from blocking everything else.
        """
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
                self._line = (self._line + byte)[:_MAX_LINE_BYTES]

    def _read(self) -> bytes:
        if self._fileno is None or not select.select([self._fileno], [], [], 0)[0]:
            return b""
        try:
            data = os.read(self._fileno, _CHUNK_BYTES)
        except OSError:
            # The terminal is no longer available: there is no more input.
            self._fileno = None
            return b""
        if not data:
            # The writer has closed the pipe; its incomplete line is dropped. Another writer may open a named
            # pipe.
            self._line = b""
        return data


@contextmanager
def typing(shown: bool) -> Iterator[LineInput]:
    """Read lines from standard input.

    If ``shown`` (another part displays the incomplete line), a terminal passes on each character and echoes
    none; its settings are restored afterwards.
    """
    fileno = _standard_input()
    if fileno is None or not shown or not os.isatty(fileno):
        yield LineInput(fileno)
        return
    before = termios.tcgetattr(fileno)
    now = termios.tcgetattr(fileno)
    now[3] &= ~(termios.ICANON | termios.ECHO)
    termios.tcsetattr(fileno, termios.TCSANOW, now)
    try:
        yield LineInput(fileno)
    finally:
        # The terminal may be gone.
        with suppress(OSError, termios.error):
            termios.tcsetattr(fileno, termios.TCSANOW, before)


def _standard_input() -> int | None:
    """Return the file descriptor of standard input, or None.

    None without standard input, and in the background of a terminal, which would stop a reading process.
    """
    try:
        fileno = sys.stdin.fileno()
        if os.isatty(fileno) and os.tcgetpgrp(fileno) != os.getpgrp():
            return None
    except (OSError, ValueError, AttributeError):
        return None
    return fileno
