"""When a shared plan begins, by our clock.

A plan carries its epoch in Unix time: both clocks are set by GPS or over the network, and a millisecond
counts for little. One that is wrong lays every plan where its sender is not, and is not to be told from a
right one by a single plan. So the clock is estimated from all of them, as those of the tracks are: the
estimate is off by what the quickest plan took longer than the least delay that is set, which is little after
some plans, and the positions of the same sender are dated alike. An epoch near the estimate is its sender's
own word, and better; another is replaced by the estimate.
"""

from __future__ import annotations

from companion.estimation.sender_clock import SenderClock

_NEAR = 50_000
"""µs between epoch and estimate: two clocks that are off by some milliseconds, and a link that is slower than
it is said to be by a few periods. At 5 m/s it is a quarter of a metre, half of d_min."""
_ENOUGH = 3
"""Plans that tell of the same wrong clock before an epoch that cannot be true is replaced."""
_MANY = 10
"""Plans before one that may be true is: of so many, with a jitter of 100 ms, one in a thousand times none is
quicker than ``_NEAR``."""


class PlanClock:
    """The clock of one sender of plans, all times µs. ``delay``: the least age of a message at its arrival;
    ``stale``: how old a plan may be."""

    __slots__ = (
        "_begins",
        "_clock",
        "_epoch",
        "_stale",
    )

    def __init__(self, delay: int, stale: int) -> None:
        self._clock = SenderClock(delay, stale)
        self._stale = stale
        self._epoch: int | None = None
        self._begins: int | None = None

    @property
    def brief(self) -> bool:
        """Whether its sender's clock is a simulation's, see ``SenderClock``."""
        return self._clock.brief

    @brief.setter
    def brief(self, value: bool) -> None:
        self._clock.brief = value

    def begins(self, now: int, epoch: int, dt: int) -> int | None:
        """When a plan of steps ``dt`` that arrives at ``now`` with ``epoch`` begins; None while it is not
        clear what to make of that. A plan that its sender holds, and tells of again, began when it did."""
        if epoch != self._epoch:
            self._epoch, self._begins = epoch, self._first(now, epoch, dt)
        return self._begins

    def _first(self, now: int, epoch: int, dt: int) -> int | None:
        dated = self._clock.date(now, epoch)
        if dated is None or not dated.stamped:
            return None
        estimate = dated.time + self._clock.skew
        possible = now - self._stale <= epoch <= now + dt
        if abs(estimate - epoch) <= _NEAR or (possible and self._clock.heard < _MANY):
            return epoch
        return estimate if self._clock.heard >= _ENOUGH else None
