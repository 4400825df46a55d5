"""Log of what a companion's fusion of detections knew, for the summary of a flight."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from typing import NamedTuple

from companion.values.horizon import Array

ROW = 13
"""Numbers of a row: position (3), its covariance (9, by rows), and how many vehicles see the target."""
_PERIOD_US = 100_000


class Counts(NamedTuple):
    """Numbers of detections: ``own`` and of ``others`` that count, ``used`` and ``refused`` by the gate.

    ``sent``: own ones that were forwarded; ``late``: older than the window; ``invalid``: dropped before the
    filter, for whatever reason.
    """

    own: int = 0
    others: int = 0
    sent: int = 0
    used: int = 0
    refused: int = 0
    late: int = 0
    invalid: int = 0


class FusionTally(NamedTuple):
    """Counters and log of one companion so far: ``times`` (n,), µs on its clock, ``rows`` (n · ROW)."""

    counts: Counts = Counts()
    times: Sequence[int] = ()
    rows: Sequence[float] = ()


class FusionLog:
    """Log with a row every tenth of a second."""

    def __init__(self) -> None:
        self._times, self._rows = array("q"), array("d")
        self._next = 0

    def due(self, now: int) -> bool:
        """Return whether the next row is due at ``now`` (µs)."""
        return now >= self._next

    def add(self, now: int, position: Array, covariance: Array, seen_by: int) -> None:
        """Add a row at ``now`` (µs); units and shapes as in ``ROW``, m."""
        self._next = now + _PERIOD_US
        self._times.append(now)
        self._rows.extend((*position.tolist(), *covariance.ravel().tolist(), float(seen_by)))

    def tally(self, counts: Counts) -> FusionTally:
        """Return what has been logged so far, with ``counts``."""
        return FusionTally(counts, self._times[:], self._rows[:])

    def clear(self) -> None:
        """Empty the log."""
        self._times, self._rows = array("q"), array("d")
