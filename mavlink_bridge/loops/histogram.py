"""How durations are distributed, counted in constant memory: logarithmic bins, as those of HdrHistogram."""

from __future__ import annotations

from array import array
from typing import Final, NamedTuple

_BITS: Final = 5
_EXACT: Final = 1 << _BITS
_OCTAVES: Final = 40


class Spread(NamedTuple):
    """Median, 99th percentile and largest of some durations (µs); all zero if there are none."""

    p50: int
    p99: int
    max: int


class Histogram:
    """Counts non-negative integers (µs). A quantile is exact below 64 and at most 1/32 too high above; what
    is above 2^45 (a year) counts as that.

    Adding takes constant time and makes nothing that a garbage collector would have to look at.
    """

    def __init__(self) -> None:
        self.count = 0
        self.max = 0
        self._bins = array("Q", bytes(8 * _EXACT * (_OCTAVES + 1)))

    def add(self, value: int) -> None:
        """Count ``value``; a negative one as 0."""
        value = max(value, 0)
        self.count += 1
        self.max = max(self.max, value)
        # The octave (by how much the value exceeds 5 bits), and the 5 bits below its leading one.
        octave = max(value.bit_length() - _BITS - 1, 0)
        place = (octave << _BITS) + (value >> octave)
        self._bins[min(place, len(self._bins) - 1)] += 1

    def include(self, other: Histogram) -> None:
        """Count all that ``other`` counted, too."""
        self.count += other.count
        self.max = max(self.max, other.max)
        for place, count in enumerate(other._bins):
            if count:
                self._bins[place] += count

    def quantile(self, fraction: float) -> int:
        """The smallest value (or the upper end of its bin) that this ``fraction`` of all does not exceed."""
        rank = fraction * self.count
        seen = 0
        for place, count in enumerate(self._bins):
            seen += count
            if count and seen >= rank:
                return min(_highest(place), self.max)
        return 0

    @property
    def spread(self) -> Spread:
        """The three figures that are reported."""
        return Spread(self.quantile(0.5), self.quantile(0.99), self.max)


def _highest(place: int) -> int:
    """The largest value that is counted at ``place``."""
    octave = max((place >> _BITS) - 1, 0)
    return ((place - (octave << _BITS) + 1) << octave) - 1
