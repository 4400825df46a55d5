"""``vehicle-N.steps.npz`` of a run directory: when the companion was stepped.

With the tlog, which has what it received and sent at these times, its flight can be gone through again to the
last bit.
"""

from __future__ import annotations

from array import array
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from outrider.errors import Fault, InputError


class StepsFile:
    """Collects the times (µs) of steps, and writes them to ``path`` when it is closed."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._times = array("q")

    def add(self, now: int) -> None:
        """A step at ``now`` (µs)."""
        self._times.append(now)

    def close(self) -> None:
        """Write them: the first time, and the gaps, which compress to almost nothing."""
        times = np.array(self._times, dtype=np.int64)
        np.savez_compressed(self._path, first=times[:1], gaps=np.diff(times))


def read_steps(path: Path) -> NDArray[np.int64]:
    """The times (n,), µs. InputError if it cannot be read."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as found:
            first, gaps = found["first"], found["gaps"]
    except (OSError, BadZipFile, ValueError, KeyError, EOFError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "it is damaged"
        raise InputError(
            Fault(str(path), f"when the companion was stepped cannot be read: {reason}")
        ) from None
    if first.dtype != np.int64 or gaps.dtype != np.int64 or first.ndim != 1 or gaps.ndim != 1:
        raise InputError(Fault(str(path), "does not hold times"))
    times: NDArray[np.int64] = np.cumsum(np.concatenate([first, gaps]))
    return times
