"""Terminal that may block, by Ctrl-S or a frozen connection: output that it does not take is dropped."""

from __future__ import annotations

import io
import os
import select
from contextlib import suppress


class Terminal(io.TextIOBase):
    """Terminal behind ``fileno``, opened a second time for non-blocking output.

    O_NONBLOCK is a property of the open file, and the original one is shared with the shell. If the terminal
    cannot be opened again, ``fileno`` itself is used and written to while it has room.
    """

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
        """Return True: this is a terminal."""
        return True

    def writable(self) -> bool:
        """Return True."""
        return True

    def fileno(self) -> int:
        """Return the file descriptor."""
        return self._fileno

    @property
    def takes(self) -> bool:
        """Whether the terminal has room for output; always false once it is gone."""
        return not self._gone and bool(select.select([], [self._fileno], [], 0)[1])

    def write(self, text: str) -> int:
        """Write as much of ``text`` as the terminal takes, without blocking; return the length of ``text``.

        Output that a closed terminal refuses counts as written: the caller would otherwise keep it and try
        again.
        """
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
        """Close the terminal."""
        if not self.closed:
            super().close()
            with suppress(OSError):
                os.close(self._fileno)
