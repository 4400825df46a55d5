"""A terminal that may stand still, by Ctrl-S or on a line that has frozen: what it does not take is lost."""

from __future__ import annotations

import io
import os
import select
from contextlib import suppress


class Terminal(io.TextIOBase):
    """The terminal behind ``fileno``, opened once more: what makes writing to it never wait is a property of
    the open file, and the other one is shared with the shell. Without a way to open it, ``fileno`` itself is
    used, and written to where there is room for something."""

    def __init__(self, fileno: int) -> None:
        self._gone = False
        try:
            self._fileno = os.open(os.ttyname(fileno), os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError:
            self._fileno = os.dup(fileno)

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """UTF-8."""
        return "utf-8"

    def isatty(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._fileno

    @property
    def takes(self) -> bool:
        """Whether there is room for something; never again in one that is gone."""
        return not self._gone and bool(select.select([], [self._fileno], [], 0)[1])

    def write(self, text: str) -> int:
        """All of it, or what it takes; it never waits. What a terminal that is gone refuses counts as
        written: whoever draws would keep it, to try again."""
        data = text.encode("utf-8", "replace")
        try:
            while data and self.takes:
                data = data[os.write(self._fileno, data) :]
        except BlockingIOError:
            pass
        except OSError:
            self._gone = True
        return len(text)

    def close(self) -> None:
        if not self.closed:
            super().close()
            with suppress(OSError):
                os.close(self._fileno)
