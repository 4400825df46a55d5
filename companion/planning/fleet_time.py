"""Avoidance by committed plans in measured fleet time: plans have fleet time, all else the own time."""

from __future__ import annotations

from typing import cast

import numpy as np

from companion.avoidance.certified.commitment import HoldReason
from companion.avoidance.certified.fleet_clock import FleetClock
from companion.avoidance.certified.flight import CertifiedFlight
from companion.planning.avoidance import AvoidanceInputs
from companion.planning.certified import CertifiedAvoidance, VehicleParts
from companion.planning.fleet_time_world import FleetTimeWorld
from companion.values.horizon import Array, Motion, roll_out
from companion.values.refused_senders import RefusedSenders
from companion.values.stance import Stance
from companion.world import World
from mavlink_bridge.messages import Message, Timesync, Tunnel
from mavlink_bridge.wire.fleet_time import PAYLOAD_TYPE

_CHECK_US = 100_000
"""Time between two comparisons with the others' fleet times, µs."""


class FleetTimeAvoidance(CertifiedAvoidance):
    """``CertifiedAvoidance`` whose times are converted by ``clock``.

    Before fleet time is known, the vehicle holds its position and announces nothing. While fleet time is not
    good enough, it carries its plan on (``HoldReason.CLOCK``).
    """

    def __init__(self, parts: VehicleParts, clock: FleetClock) -> None:
        # Constraints are made of a part of the world only, and ``FleetTimeWorld`` has this part.
        super().__init__(parts._replace(world=cast(World, FleetTimeWorld(parts.world, clock))))
        self._own, self._fleet, self._clock = parts.own, parts.fleet, clock
        self._next_check = 0

    def begin(self, now: int, measured: Motion) -> None:
        """Hold the ``measured`` position, or continue the committed plan."""
        fleet = self._fleet_time(now)
        if self._may_begin(now, measured) and fleet is not None:
            self._flight.stand(fleet, measured.position)

    def park(self, now: int, measured: Motion, stance: Stance) -> None:
        """Hold the column of a vehicle on the ground, or one that climbs, once fleet time is known."""
        fleet = self._fleet_time(now)
        if fleet is not None:
            super().park(fleet, measured, stance)

    def wait(self, now: int) -> str:
        """Return what is missing for the reservation of the column; an empty string: nothing."""
        if self._clock.ahead is None or self._clock.trouble is not None:
            return "fleet time"
        return super().wait(now + self._clock.ahead)

    def fly(self, now: int, situation: AvoidanceInputs) -> Array | None:
        """Bring the committed plan up to date, see ``CertifiedAvoidance.fly``."""
        fleet = self._fleet_time(now)
        if fleet is None:
            if self._may_begin(now, situation.measured):
                self._wait(now, situation.measured)
            return None
        if self._flight.commitment.current is None and self._may_begin(now, situation.measured):
            self._flight.stand(fleet, situation.measured.position)
        places = super().fly(fleet, situation)
        if self.horizon is not None:
            self.horizon = self.horizon._replace(epoch=self.horizon.epoch - (fleet - now))
        return places

    def idle(self, now: int) -> bool:
        """Return whether no plan, no announcement, no reply and no yaw plan is due at ``now`` (µs)."""
        ahead = self._clock.ahead
        return ahead is not None and self._clock.idle and super().idle(now + ahead)

    def receive(self, now: int, link: str, message: Message) -> bool:
        """Receive TUNNEL and TIMESYNC of the swarm link; plans do not count before fleet time is known."""
        if link != "swarm" or not isinstance(message, Tunnel | Timesync):
            return False
        if isinstance(message, Timesync) or message.payload_type == PAYLOAD_TYPE:
            self._clock.receive(now, link, message)
        elif self._clock.ahead is not None:
            super().receive(now + self._clock.ahead, link, message)
        return True

    def messages(self, now: int, *, farewell: bool) -> list[Message]:
        """Return the messages of fleet time, and the announcements of the committed plan."""
        fleet = self._fleet_time(now)
        found = self._clock.messages(now)
        if fleet is not None:
            # Round trips are made by ``clock``, on the companions' own clocks.
            announced = super().messages(fleet, farewell=farewell)
            found += [message for message in announced if not isinstance(message, Timesync)]
        return found

    def refused(self, now: int) -> RefusedSenders:
        """Return the senders whose plans are refused at ``now`` (µs); none before fleet time is known."""
        return RefusedSenders() if self._clock.ahead is None else super().refused(now + self._clock.ahead)

    def _replan(self, now: int, situation: AvoidanceInputs) -> None:
        """Make the next epoch's plan, or carry the old one on while fleet time is not good enough."""
        commitment = self._flight.commitment
        if self._clock.trouble is None:
            super()._replan(now, situation)
            self._times.plan_at[-1] -= self._clock.ahead or 0
        elif commitment.last_call(now):
            commitment.carry_on(HoldReason.CLOCK)

    def _fleet_time(self, now: int) -> int | None:
        """Return fleet time (µs) at ``now`` (µs); None if it is not known."""
        clock = self._clock
        free = not self._flight.commitment.announced_until or self.parked
        if clock.step(now, free=free) and clock.ahead is not None:
            if self._flight.commitment.current is not None:
                self._flight = CertifiedFlight(self._config, self._own, self._fleet)
            self.next_due = now + clock.ahead
        if clock.ahead is None:
            return None
        if now >= self._next_check:
            self._next_check = now + _CHECK_US
            self._flight.clocks.ahead = clock.differences(now)
        return now + clock.ahead

    def _wait(self, now: int, measured: Motion) -> None:
        """Fly a horizon at rest at the position where the wait began."""
        if self.horizon is None:
            steps, dt = self._config.horizon.steps + 1, self._config.horizon.dt_us
            zero = np.zeros(3)
            self.horizon = roll_out(now, dt, measured.position, zero, np.zeros((steps, 3)))
