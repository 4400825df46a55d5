"""Progress where standard error is no terminal: a line now and then, for who reads a file or a pipe."""

from __future__ import annotations

import sys
import time

LINE_S = 20.0


class ProgressLines:
    """Nothing in the first ``LINE_S`` seconds: what is that quick needs no progress."""

    def __init__(self) -> None:
        self._said = time.monotonic()

    @property
    def due(self) -> bool:
        """Whether it is time for a line."""
        return time.monotonic() - self._said >= LINE_S

    def say(self, words: str) -> None:
        """A line of its own, if it is time for one."""
        if self.due:
            self._said = time.monotonic()
            sys.stderr.write(words + "\n")
            sys.stderr.flush()
