"""When a shared plan begins, by our clock, if its sender's clock cannot be right.

A plan carries its epoch in Unix time: both clocks are set by GPS or over the network, and a millisecond
counts for little. One that is off by more than a plan's life makes every plan look outdated, or not yet true,
and its sender a thing that stands still. That clock is estimated instead, as those of the tracks are.
"""

from __future__ import annotations

from companion.timing import SenderClock

_EVIDENCE = 3
"""Plans in a row that tell of the same wrong clock before it is believed."""


class PlanClock:
    """The clock of one sender of plans, all times µs. ``delay``: the least age of a message at its arrival;
    ``stale``: how old a plan may be."""

    def __init__(self, delay: int, stale: int) -> None:
        self._clock = SenderClock(delay, stale)
        self._stale = stale
        self._told = 0

    def begins(self, now: int, epoch: int, dt: int) -> int | None:
        """When a plan that arrives at ``now`` with ``epoch`` begins: as it says, unless that is more than a
        step ``dt`` ahead or longer ago than plans live. None while it is not clear what to make of that."""
        if now - self._stale <= epoch <= now + dt:
            self._told = 0
            return epoch
        dated = self._clock.date(now, epoch)
        if dated is None or not dated.stamped:
            self._told = 0
            return None
        self._told += 1
        if self._told < _EVIDENCE:
            return None
        return dated.time + self._clock.skew
