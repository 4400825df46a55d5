"""Fleet time by the messages of the other companions, on the own clock.

Each companion sends fleet time relative to its own clock (TUNNEL 0xDC04); round trips (``ClockWatch``) bound
that clock on the own one.
"""

from __future__ import annotations

from collections.abc import Set
from typing import NamedTuple

from companion.avoidance.certified.clocks import ClockBounds, ClockWatch
from companion.config.certified import TimeSourcesConfig
from companion.estimation.fleet_time import Offset
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.messages import Source, Timesync, Tunnel
from mavlink_bridge.wire.fleet_time import FleetTime, unpack

_MAX_AGE_US = 10_000_000
"""Age (µs) from which a message or a round trip is not used any more."""
_MAX_OFFSET_US = 1 << 60
"""Offsets beyond it cannot be meant, and sums with them would not fit the wire."""


class _Received(NamedTuple):
    message: FleetTime
    at: int


class PeerTimes:
    """Fleet time of the others for the companion ``own``.

    Only messages of companions with an id in ``fleet`` count; if it is empty, those of all companions.
    """

    def __init__(self, own: Source, fleet: Set[int], config: TimeSourcesConfig) -> None:
        self._own, self._fleet = own, fleet
        self._drift, self._lateness = config.drift_ppm, config.lateness_us
        # ``ClockWatch.wrong`` is not used: the clocks themselves may differ by any amount.
        self._clocks = ClockWatch(own, 0)
        self._received: dict[int, _Received] = {}
        self._replies: list[Timesync] = []
        self.refused = 0
        """Number of messages that could not be decoded, or give impossible values."""

    @property
    def idle(self) -> bool:
        """Whether no reply waits to be sent."""
        return not self._replies

    def receive(self, now: int, message: Timesync | Tunnel) -> None:
        """Receive TIMESYNC, or TUNNEL with a fleet time."""
        system, component = message.source
        if isinstance(message, Timesync):
            self._replies += self._clocks.receive(now, message)
            return
        if component != self._own.component or system == self._own.system:
            return
        if self._fleet and system not in self._fleet:
            return
        try:
            received = unpack(message.payload)
        except PlanWireError:
            self.refused += 1
            return
        if any(abs(value) > _MAX_OFFSET_US for value in (received.ahead or 0, *(received.estimate or ()))):
            self.refused += 1
            return
        self._received[system] = _Received(received, now)

    def messages(self, now: int) -> list[Timesync]:
        """Return the replies to requests, and the own request if it is due at ``now`` (µs)."""
        found = [*self._replies, *self._clocks.due(now)]
        self._replies.clear()
        return found

    def clock(self, now: int, system: int) -> Offset | None:
        """Return by how much the clock of ``system`` is ahead of the own one; None if it is not known."""
        bounds = self._clocks.ahead.get(system)
        if bounds is None or now - bounds.at > _MAX_AGE_US:
            return None
        # Both companions date messages by the start of a step, and read them later.
        return Offset(*bounds).aged(now, self._drift).shifted(-self._lateness, self._lateness)

    def estimates(self, now: int) -> list[Offset]:
        """Return fleet time ahead of the own clock, by the own sources of each of the others."""
        found = []
        for system, (message, at) in self._received.items():
            clock = self.clock(now, system)
            if message.estimate is None or clock is None or now - at > _MAX_AGE_US:
                continue
            # ``age`` is the largest that the message may have, by the sender's clock.
            age = now + clock.most - message.time
            if 0 <= age <= _MAX_AGE_US:
                ahead, bound = message.estimate
                offset = Offset(ahead - bound, ahead + bound, now - age).aged(now, self._drift)
                found.append(clock.shifted(offset.least, offset.most))
        return found

    def differences(self, now: int, ahead: int) -> dict[int, ClockBounds]:
        """Return by how much each of the others' fleet time is ahead of the own one, by system id.

        ``ahead`` (µs): own fleet time minus own time.
        """
        found = {}
        for system, (message, at) in self._received.items():
            clock = self.clock(now, system)
            if message.ahead is not None and clock is not None and now - at <= _MAX_AGE_US:
                between = clock.shifted(message.ahead - ahead, message.ahead - ahead)
                found[system] = ClockBounds(between.least, between.most, now)
        return found
