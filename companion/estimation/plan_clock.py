"""Clock of a sender of plans: estimates when a shared plan begins, on the own clock.

A plan carries its epoch in Unix time. Usually both clocks are set by GPS or over the network, and a
millisecond matters little. A wrong clock, however, shifts every plan away from its sender's true position,
and a single plan does not show that the clock is wrong. So the clock is estimated from all plans, as the
tracks' clocks are (``SenderClock``). The estimate is late by the time by which the fastest plan exceeded the
configured least delay, which is small after some plans. An epoch near the estimate is used as sent, since it
is more accurate; any other epoch is replaced by the estimate after enough plans.
"""

from __future__ import annotations

from companion.estimation.sender_clock import SenderClock

_EPOCH_TOLERANCE_US = 50_000
"""Tolerated difference between epoch and estimate.

It covers two clocks that are off by some milliseconds, and a link that is slower than configured by a few
periods. At 5 m/s it corresponds to 0.25 m.
"""
_MIN_PLANS = 3
"""Number of consistent plans before an epoch is replaced by the estimate.

With fewer, the beginning of a plan with an impossible epoch (in the future, or too old) is unknown.
"""
_MIN_PLANS_POSSIBLE_EPOCH = 10
"""Number of plans before a possible epoch is replaced by the estimate.

With a uniform jitter of 0…100 ms, the probability is 0.001 that all ten are later than
``_EPOCH_TOLERANCE_US``.
"""


class PlanClock:
    """The clock of one sender of plans; all times in µs.

    ``delay``: the least age of a message at its arrival; ``stale``: largest age of a possible epoch.
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

        ``epoch`` is on the sender's clock, the result on the own one. Returns None while the beginning cannot
        be determined. A plan that is sent again, with the same epoch, keeps its result.
        """
        if epoch == self._epoch:
            return self._begins
        self._epoch, clock = epoch, self._clock
        dated = clock.date(now, epoch)
        if dated is None or not dated[1]:
            begins = None
        else:
            estimate = dated[0] + clock.skew
            possible = now - self._stale <= epoch <= now + dt and clock.support < _MIN_PLANS_POSSIBLE_EPOCH
            if possible or -_EPOCH_TOLERANCE_US <= estimate - epoch <= _EPOCH_TOLERANCE_US:
                begins = epoch
            else:
                begins = estimate if clock.support >= _MIN_PLANS else None
        self._begins = begins
        return begins
