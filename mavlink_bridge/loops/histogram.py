"""Distribution of durations in constant memory: logarithmic bins, as in HdrHistogram."""

from __future__ import annotations

from array import array
from typing import Final, NamedTuple

_BITS: Final = 5
_BINS_PER_OCTAVE: Final = 1 << _BITS
_OCTAVES: Final = 40


class Spread(NamedTuple):
    """Median, 99th percentile and maximum of some durations (µs); all zero if there are none."""

    p50: int
    p99: int
    max: int


class Histogram:
    """Counts of non-negative integers (µs) in logarithmic bins.

    A quantile is exact below 64 and at most 1/32 too high above. All values from 2^45 µs (a year) on share
    the last bin; ``max`` is exact.

    Adding takes constant time and creates no object that the garbage collector tracks.
    """

    def __init__(self) -> None:
        self.count = 0
        self.max = 0
        self._bins = array("Q", bytes(8 * _BINS_PER_OCTAVE * (_OCTAVES + 1)))

    def add(self, value: int) -> None:
        """Count ``value``; a negative value counts as 0."""
        value = max(value, 0)
        self.count += 1
        self.max = max(self.max, value)
        # The bin number is like a floating-point number: an exponent (octave), and 5 bits behind the leading
        # one. Values of up to 6 bits have a bin of their own.
        octave = max(value.bit_length() - _BITS - 1, 0)
        place = (octave << _BITS) + (value >> octave)
        self._bins[min(place, len(self._bins) - 1)] += 1

    def include(self, other: Histogram) -> None:
        """Add all counts of ``other``."""
        self.count += other.count
        self.max = max(self.max, other.max)
        for place, count in enumerate(other._bins):
            if count:
                self._bins[place] += count

    def quantile(self, fraction: float) -> int:
        """Return the smallest value that at least ``fraction`` of the counted values do not exceed.

        It is rounded up to the end of its bin, and limited to ``max``; 0 if nothing was counted.
        """
        rank = fraction * self.count
        seen = 0
        for place, count in enumerate(self._bins):
            seen += count
            if count and seen >= rank:
                return min(_highest(place), self.max)
        return 0

    @property
    def spread(self) -> Spread:
        """The three reported figures: median, 99th percentile and maximum."""
        return Spread(self.quantile(0.5), self.quantile(0.99), self.max)


def _highest(place: int) -> int:
    """Return the largest value that is counted at ``place``."""
    octave = max((place >> _BITS) - 1, 0)
    return ((place - (octave << _BITS) + 1) << octave) - 1
