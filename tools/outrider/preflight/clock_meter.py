"""Measurement of the clock: the bound of the error of fleet time, or how far the clocks may be apart."""

from __future__ import annotations

from collections.abc import Collection

from companion.avoidance.certified.fleet_clock import FleetClock
from companion.avoidance.certified.peer_times import PeerTimes
from companion.config.certified import CertifiedConfig
from mavlink_bridge.clocks.system_clock import SystemClock
from mavlink_bridge.messages import Message, Source, SystemTime, Timesync, Tunnel

WORST = 100_000
"""Largest value (µs) of ``certified.clock_us``."""


class ClockMeter:
    """Clock of the companion ``own`` with the settings ``config``.

    With ``fleet_time: measured`` the bound is that of fleet time. With ``own`` the clocks of the fleet are
    compared by round trips: if no two can be further apart than D, each is within D/2 of the middle.
    ``bound`` (µs): the largest since ``begin``; None if it was unknown at some time.
    """

    def __init__(self, config: CertifiedConfig, own: Source, system_clock: SystemClock | None) -> None:
        self._others = frozenset(config.fleet) - {own.system}
        measured = config.fleet_time == "measured"
        # With the largest allowed bound the clock gives a time whatever the bound turns out to be.
        loose = config.model_copy(update={"clock_us": WORST})
        self._fleet = FleetClock(loose, own, system_clock) if measured else None
        self._peers = (
            PeerTimes(own, self._others, config.time_sources) if self._fleet is None else self._fleet.peers
        )
        self._begun = False
        self.bound: int | None = None
        self._known = True

    def receive(self, now: int, link: str, message: SystemTime | Timesync | Tunnel) -> None:
        """Receive a message about time."""
        if self._fleet is not None:
            self._fleet.receive(now, link, message)
        elif link == "swarm" and not isinstance(message, SystemTime):
            self._peers.receive(now, message)

    def begin(self) -> None:
        """Begin to measure."""
        self._begun, self._known, self.bound = True, True, None

    def tick(self, now: int) -> None:
        """Bring ``bound`` up to date at ``now`` (µs)."""
        if self._fleet is not None:
            self._fleet.step(now, free=True)
        if not self._begun:
            return
        bound = self._now(now, self._others)
        self._known = self._known and bound is not None
        self.bound = max(self.bound or 0, bound) if self._known and bound is not None else None

    def _now(self, now: int, others: Collection[int]) -> int | None:
        """Return the bound at ``now`` (µs), None if it is unknown."""
        if self._fleet is not None:
            return None if self._fleet.ahead is None else self._fleet.error
        clocks = [self._peers.clock(now, system) for system in sorted(others)]
        apart = [max(abs(clock.least), abs(clock.most)) for clock in clocks if clock is not None]
        return -(-max(apart, default=0) // 2) if len(apart) == len(others) else None

    def ready(self, now: int) -> bool:
        """Return whether the bound is known at ``now`` (µs)."""
        return self._now(now, self._others) is not None

    def to_autopilot(self, now: int) -> list[Message]:
        """Return the requests to the autopilot at ``now`` (µs)."""
        return [] if self._fleet is None else self._fleet.requests(now)

    def to_swarm(self, now: int) -> list[Message]:
        """Return the messages to the others at ``now`` (µs)."""
        return [*self._peers.messages(now)] if self._fleet is None else self._fleet.messages(now)
