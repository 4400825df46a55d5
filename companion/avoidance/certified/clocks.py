"""Whether the others' clocks are right, as far as messages can tell.

Plans meet on absolute knots, so every clock must be within ``clock_us`` of fleet time; GPS or the network
sees to that, and the margin allows for it. TIMESYNC (111) watches over it: a reply that shows tc was made
after its request left at ts and before it arrived at now, by our clock; so the other clock is ahead by
something between tc − now and tc − ts, whatever the delays and however unequal. Each round trip narrows that,
and drift widens it. A clock is wrong when nothing that two right clocks may differ by is left between the
two.
"""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.messages import Source, Timesync

_PERIOD = 1_000_000
"""µs between two requests."""
_DRIFT_PPM = 200
_NS = 1000
"""In a µs; a request's last three digits are its sender's system id, so that replies find home."""


class Ahead(NamedTuple):
    """By how much another clock is ahead: at least and at most, µs, as known at ``at`` (µs)."""

    least: int
    most: int
    at: int


class ClockWatch:
    """Of one vehicle over all others. ``bound``: µs that a clock may differ from fleet time."""

    def __init__(self, own: Source, bound: int) -> None:
        self._own, self._bound = own, bound
        self._next = 0
        self.ahead: dict[int, Ahead] = {}

    def due(self, now: int) -> list[Timesync]:
        """The request, when it is time for one."""
        if now < self._next:
            return []
        self._next = now + _PERIOD
        return [Timesync(self._own, 0, now * _NS + self._own.system)]

    def receive(self, now: int, message: Timesync) -> list[Timesync]:
        """A request, and the reply to it; or a reply, which is noted if it is to one of ours and from a
        companion: an autopilot may answer as well, by the time since it was switched on."""
        if message.tc1 == 0:
            return [Timesync(self._own, now * _NS, message.ts1)]
        asked, system = divmod(message.ts1, _NS)
        if message.source.component != self._own.component:
            return []
        if system != self._own.system or not 0 <= now - asked <= 10 * _PERIOD:
            return []
        shown = message.tc1 // _NS
        found = Ahead(shown - now, shown - asked, now)
        before = self.ahead.get(message.source.system)
        if before is not None:
            slack = (now - before.at) * _DRIFT_PPM // 1_000_000 + 1
            both = Ahead(max(found.least, before.least - slack), min(found.most, before.most + slack), now)
            # Where nothing is left the clock was set in between, and the new answer alone counts.
            found = both if both.least <= both.most else found
        self.ahead[message.source.system] = found
        return []

    @property
    def wrong(self) -> frozenset[int]:
        """System ids whose clock and ours cannot both be right."""
        most = 2 * self._bound
        return frozenset(system for system, one in self.ahead.items() if one.least > most or one.most < -most)
