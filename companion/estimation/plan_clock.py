"""Clock of a sender of plans: estimates when a shared plan begins, on the own clock.

A plan carries its epoch in Unix time. Usually both clocks are set by GPS or over the network, and a
millisecond matters little. A wrong clock, however, shifts every plan away from its sender's true position,
and a single plan does not show that the clock is wrong. So the clock is estimated from all plans, as the
tracks' clocks are: the error of the estimate is the time by which the fastest plan exceeded the configured
least delay, which is small after some plans, and the positions of the same sender are dated alike. An epoch
near the estimate is used as sent, since it is more accurate; any other is replaced by the estimate.
"""

from __future__ import annotations

from companion.estimation.sender_clock import SenderClock

_NEAR = 50_000
"""µs; tolerated difference between epoch and estimate.

It covers two clocks that are off by some milliseconds, and a link that is slower than configured by a few
periods. At 5 m/s it is a quarter of a metre, half of d_min.
"""
_ENOUGH = 3
"""Number of consistent plans before an impossible epoch is replaced by the estimate."""
_MANY = 10
"""Number of plans before a possible epoch is replaced by the estimate.

With a jitter of 100 ms, the probability that none of ten is faster than ``_NEAR`` is one in a thousand.
"""


class PlanClock:
    """The clock of one sender of plans; all times in µs.

    ``delay``: the least age of a message at its arrival; ``stale``: how old a plan may be.
    """

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
        """Whether the sender's clock is a simulation's clock, see ``SenderClock``."""
        return self._clock.brief

    @brief.setter
    def brief(self, value: bool) -> None:
        self._clock.brief = value

    def begins(self, now: int, epoch: int, dt: int) -> int | None:
        """Return when a plan with ``epoch`` and steps of ``dt``, received at ``now``, begins.

        Returns None while that cannot be determined. A plan that its sender keeps, and sends again, keeps its
        beginning.
        """
        if epoch != self._epoch:
            self._epoch, self._begins = epoch, self._first(now, epoch, dt)
        return self._begins

    def _first(self, now: int, epoch: int, dt: int) -> int | None:
        dated = self._clock.date(now, epoch)
        if dated is None or not dated.stamped:
            return None
        estimate = dated.time + self._clock.skew
        possible = now - self._stale <= epoch <= now + dt
        if abs(estimate - epoch) <= _NEAR or (possible and self._clock.support < _MANY):
            return epoch
        return estimate if self._clock.support >= _ENOUGH else None
