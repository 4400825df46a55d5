"""Monitor of the other vehicles' clocks, as far as messages can show their error.

The knots of plans are absolute times, so every clock must be within ``clock_us`` of fleet time. GPS or the
network provides this accuracy, and the margin allows for ``clock_us``. TIMESYNC (111) monitors it: a reply
that shows tc was made after its request left at ts and before it arrived at now, by the own clock. So the
other clock is ahead by between tc − now and tc − ts, whatever the delays and however unequal they are. Round
trips narrow this interval, and drift widens it. A clock is wrong when the whole interval lies outside
±2·``clock_us``, the difference that two correct clocks may have.
"""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.messages import Source, Timesync

_PERIOD_US = 1_000_000
"""Time between two requests, µs."""
_DRIFT_PPM = 200
"""Rate at which the bounds of another clock widen with time."""
_NS_PER_US = 1000
"""Nanoseconds in a µs; the last three digits of a request are its sender's system id, to find its reply."""


class ClockBounds(NamedTuple):
    """Another clock is ahead of the own by ``least`` to ``most`` µs, as known at ``at`` (µs)."""

    least: int
    most: int
    at: int


class ClockWatch:
    """Clock monitor of one vehicle for all others.

    ``bound``: time (µs) by which a clock may differ from fleet time.
    """

    def __init__(self, own: Source, bound: int) -> None:
        self._own, self._bound = own, bound
        self._next = 0
        self.ahead: dict[int, ClockBounds] = {}
        """Bounds of each vehicle's clock, by system id."""

    def due(self, now: int) -> list[Timesync]:
        """Return the request if one is due at ``now`` (µs), otherwise an empty list."""
        if now < self._next:
            return []
        self._next = now + _PERIOD_US
        return [Timesync(self._own, 0, now * _NS_PER_US + self._own.system)]

    def receive(self, now: int, message: Timesync) -> list[Timesync]:
        """Receive a TIMESYNC: return the reply to a request, or update the bounds by a reply.

        Only companions count. Where links are joined, autopilots ask as well, PX4 ten times a second, and
        each of them would be answered by every companion; and they answer, with the time since they were
        switched on. A reply is used if it answers a request that this vehicle made in the last 10 s.
        """
        if message.source.component != self._own.component:
            return []
        if message.tc1 == 0:
            return [Timesync(self._own, now * _NS_PER_US, message.ts1)]
        asked, system = divmod(message.ts1, _NS_PER_US)
        if system != self._own.system or not 0 <= now - asked <= 10 * _PERIOD_US:
            return []
        shown = message.tc1 // _NS_PER_US
        found = ClockBounds(shown - now, shown - asked, now)
        before = self.ahead.get(message.source.system)
        if before is not None:
            slack = (now - before.at) * _DRIFT_PPM // 1_000_000 + 1
            both = ClockBounds(
                max(found.least, before.least - slack), min(found.most, before.most + slack), now
            )
            # An empty intersection means that the clock was set in between: only the new bounds hold.
            found = both if both.least <= both.most else found
        self.ahead[message.source.system] = found
        return []

    @property
    def wrong(self) -> frozenset[int]:
        """System ids of the vehicles whose clock and the own clock cannot both be within the bound."""
        most = 2 * self._bound
        return frozenset(system for system, one in self.ahead.items() if one.least > most or one.most < -most)
