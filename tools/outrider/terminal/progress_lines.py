"""Progress where standard error is no terminal: a line now and then, for who reads a file or a pipe."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

LINE_S = 20.0


class ProgressLines:
    """Nothing in the first ``LINE_S`` seconds: what is that quick needs no progress. And nothing more once
    nobody reads it."""

    def __init__(self) -> None:
        self._said = time.monotonic()
        self._read = True

    def say(self, words: Callable[[], str]) -> None:
        """A line of its own, if it is time for one."""
        if not self._read or time.monotonic() - self._said < LINE_S:
            return
        self._said = time.monotonic()
        try:
            sys.stderr.write(words() + "\n")
            sys.stderr.flush()
        except (OSError, ValueError):
            # A pipe whose reader is gone ends no flight.
            self._read = False
