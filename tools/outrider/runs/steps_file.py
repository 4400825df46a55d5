"""``vehicle-N.steps.npz`` of a run directory: the step times of the companion.

The tlog holds what the companion received and sent at these times. With the two files the companion's flight
can be replayed bit for bit.
"""

from __future__ import annotations

from array import array
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from outrider.errors import Fault, InputError
from outrider.runs.array_file import read_arrays


class StepsFile:
    """Collector of step times (µs), which writes them to ``path`` when it is closed.

    The gaps between steps are usually equal. A sequence of equal gaps is kept in memory as the gap and the
    number (at least 1) of these gaps, so a day takes little memory.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._first: int | None = None
        self._last = 0
        self._gaps, self._counts = array("q"), array("q")

    def add(self, now: int) -> None:
        """Add a step at ``now`` (µs)."""
        if self._first is None:
            self._first = self._last = now
            return
        gap, self._last = now - self._last, now
        if self._gaps and self._gaps[-1] == gap:
            self._counts[-1] += 1
        else:
            self._gaps.append(gap)
            self._counts.append(1)

    def close(self) -> None:
        """Write the first time and all gaps; equal gaps take little space in the compressed file."""
        first = np.array([] if self._first is None else [self._first], dtype=np.int64)
        gaps = np.repeat(np.array(self._gaps, dtype=np.int64), np.array(self._counts, dtype=np.int64))
        np.savez_compressed(self._path, first=first, gaps=gaps)


def read_steps(path: Path) -> NDArray[np.int64]:
    """Return the step times (n,), µs; raise InputError if the file cannot be read."""
    arrays = read_arrays(path, {"first": ("F",), "gaps": ("n",)})
    steps = np.concatenate([arrays["first"], arrays["gaps"]])
    if steps.dtype != np.int64:
        raise InputError(Fault(str(path), "holds times that are not int64"))
    times: NDArray[np.int64] = np.cumsum(steps)
    return times
