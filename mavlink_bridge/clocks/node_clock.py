"""Clock of one node's computer relative to true time: with a constant offset and a constant drift.

All arithmetic is in integers: on any machine ``instant`` is exactly the first true time at which ``reading``
reaches a value.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite

from mavlink_bridge.errors import ScheduleError

QUANTUM = 4
"""Resolution (µs) of every time that a node receives.

The two low bits of a tlog's time stamp carry the link, so these times are multiples of 4 µs.
"""
LARGEST_DRIFT_PPM = 100_000.0
"""Limit of the drift in both directions."""

_BILLION = 1_000_000_000


@dataclass(frozen=True, slots=True)
class NodeClock:
    """Linear clock that shows ``since + offset`` at true time ``since`` (µs; negative offset: it is behind).

    It runs ``drift_ppm`` fast (negative: slow; resolved to 0.001 ppm). Raises ScheduleError for
    a drift that is not within ±100 000 ppm.
    """

    offset: int = 0
    drift_ppm: float = 0.0
    since: int = 0
    _rate: int = field(init=False, repr=False, compare=False)
    """Advance of the clock (µs) in 10⁹ µs of true time."""

    def __post_init__(self) -> None:
        if not (isfinite(self.drift_ppm) and abs(self.drift_ppm) <= LARGEST_DRIFT_PPM):
            raise ScheduleError(
                f"drift = {self.drift_ppm} ppm of a clock is not within ±{LARGEST_DRIFT_PPM:.0f} ppm"
            )
        object.__setattr__(self, "_rate", _BILLION + round(self.drift_ppm * 1000))

    def reading(self, true: int) -> int:
        """Return what the clock shows (µs, rounded down) at ``true`` (µs)."""
        return self.since + self.offset + (true - self.since) * self._rate // _BILLION

    def local(self, true: int) -> int:
        """Return the time that a node receives at ``true`` (µs): the reading, rounded down to 4 µs."""
        shown = self.reading(true)
        return shown - shown % QUANTUM

    def instant(self, shown: int) -> int:
        """Return the first true time (µs) at which the clock shows ``shown`` (µs) or more."""
        return self.since - (self.since + self.offset - shown) * _BILLION // self._rate
