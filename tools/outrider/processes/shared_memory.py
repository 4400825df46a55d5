"""Memory that a process shares with the processes that it forks later.

A reader may see a group of several numbers half old and half new.
"""

from __future__ import annotations

import mmap

import numpy as np
from numpy.typing import NDArray

_TEXT = 256
"""Size of a text, bytes."""


class SharedMemory:
    """Memory for ``flags`` (n,) int64 and ``numbers`` (m,) float64, all zero at first, and for texts."""

    def __init__(self, flags: int, numbers: int, texts: int) -> None:
        self._begin = 8 * (flags + numbers)
        self._memory = mmap.mmap(-1, self._begin + texts * _TEXT)
        self.flags: NDArray[np.int64] = np.frombuffer(self._memory, np.int64, flags)
        self.numbers: NDArray[np.float64] = np.frombuffer(self._memory, np.float64, numbers, 8 * flags)

    def write(self, index: int, text: str) -> None:
        """Write the text at ``index``, truncated to 255 bytes of UTF-8."""
        begin, data = self._begin + index * _TEXT, text.encode(errors="replace")[: _TEXT - 1]
        self._memory[begin : begin + _TEXT] = data + bytes(_TEXT - len(data))

    def read(self, index: int) -> str:
        """Return the text at ``index``."""
        begin = self._begin + index * _TEXT
        return self._memory[begin : begin + _TEXT].split(b"\0")[0].decode(errors="replace")
