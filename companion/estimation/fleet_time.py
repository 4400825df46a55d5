"""Fleet time from several sources: intersection of intervals, of which a fixed minority may be wrong.

Fleet time is one time for all vehicles: UTC, or the clock of a reference vehicle. Each source tells by how
much fleet time is ahead of the own clock, as an interval. The method is Marzullo's (Marzullo and Owicki,
"Maintaining the time in a distributed system", 1983), which NTP uses too (RFC 5905, section 11.2.1). NTP
accepts the largest set of sources that agree. Here the number of wrong sources is a setting, because only
then the result is sure to hold the truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

_MILLION = 1_000_000


class Offset(NamedTuple):
    """Another clock, or fleet time, is ahead of the own clock by ``least`` to ``most`` µs.

    ``at``: time (µs, own clock) at which this is known.
    """

    least: int
    most: int
    at: int

    @property
    def middle(self) -> int:
        """Middle of the interval, µs, rounded down."""
        return (self.least + self.most) // 2

    @property
    def bound(self) -> int:
        """Largest error (µs) of ``middle``."""
        return self.most - self.middle

    def aged(self, now: int, drift_ppm: int) -> Offset:
        """Return the interval at ``now`` (µs), if the two clocks drift apart by up to ``drift_ppm``."""
        passed = abs(now - self.at)
        if not passed:
            return self
        # Rounded up, so that no sequence of short steps loses any of the drift.
        slack = -(-passed * drift_ppm // _MILLION)
        return Offset(self.least - slack, self.most + slack, now)

    def narrowed(self, newer: Offset, drift_ppm: int) -> Offset | None:
        """Return the intersection with a ``newer`` interval at its time; None if they have no common point.

        No common point means that one of the clocks has been set in between.
        """
        old = self.aged(newer.at, drift_ppm)
        both = Offset(max(old.least, newer.least), min(old.most, newer.most), newer.at)
        return both if both.least <= both.most else None

    def shifted(self, least: int, most: int) -> Offset:
        """Return the sum with an interval from ``least`` to ``most`` (µs)."""
        return Offset(self.least + least, self.most + most, self.at)


def agreed(offsets: Sequence[Offset], wrong: int, now: int) -> Offset | None:
    """Return the interval at ``now`` (µs) that holds the truth if at most ``wrong`` of ``offsets`` do not.

    It reaches from the first to the last point that all but ``wrong`` of the intervals have in common. At
    most a minority may be wrong: of one or two sources none, of three or four one. Returns None without
    sources, and if no point is in enough of them: then more than ``wrong`` are wrong.
    """
    count = len(offsets)
    if not count:
        return None
    enough = count - min(wrong, (count - 1) // 2)
    lows = sorted(offset.least for offset in offsets)
    highs = sorted(offset.most for offset in offsets)
    # Of all points in enough intervals the first is the begin of one of them, and the last the end of one.
    firsts = [low for low in lows if _holding(offsets, low) >= enough]
    lasts = [high for high in highs if _holding(offsets, high) >= enough]
    return Offset(firsts[0], lasts[-1], now) if firsts else None


def _holding(offsets: Sequence[Offset], point: int) -> int:
    """Return how many of ``offsets`` hold ``point`` (µs)."""
    return sum(offset.least <= point <= offset.most for offset in offsets)
