"""Progress where standard error is no terminal: a line now and then, for files and pipes."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

LINE_S = 20.0


class ProgressLines:
    """Progress lines at intervals of at least ``LINE_S`` seconds, the first after the first interval.

    No more lines are written once standard error has failed.
    """

    def __init__(self) -> None:
        self._said = time.monotonic()
        self._read = True

    def say(self, words: Callable[[], str]) -> None:
        """Write a line if one is due."""
        if not self._read or time.monotonic() - self._said < LINE_S:
            return
        self._said = time.monotonic()
        try:
            sys.stderr.write(words() + "\n")
            sys.stderr.flush()
        except (OSError, ValueError):
            # A pipe whose reader is gone must not end a flight.
            self._read = False
