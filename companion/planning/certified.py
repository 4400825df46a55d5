"""Avoidance by committed plans: the committed plan is flown, and the next epoch's is made when it is due."""

from __future__ import annotations

from typing import NamedTuple

from companion.avoidance.certified.commitment import HoldReason
from companion.avoidance.certified.committed import rest_time
from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.field.plan_log import PlanLog
from companion.config import CompanionConfig
from companion.config.planning import MethodName
from companion.flight.guard import Holding
from companion.flight.lowering import Lowered
from companion.flight.plan_tracking import PlanTracking
from companion.flight.state_machine import Pilot
from companion.planning.avoidance import AvoidanceInputs, Tally
from companion.planning.plan_times import PlanTimes
from companion.values.horizon import Array, Horizon, Motion
from companion.values.refused_senders import RefusedSenders
from companion.values.stance import Stance
from companion.world import View, World
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Message, Source, Timesync, Tunnel

_NOT_ASKED = "its column"
"""What a vehicle waits for that has not begun to reserve it."""
_REST_SPEED, _REST_US = 0.3, 500_000
"""A vehicle rests if it was slower than this (m/s, on each axis) for this time (µs)."""


class VehicleParts(NamedTuple):
    """Parts of one companion that its certified avoidance uses: settings, identity, inputs and stopwatch."""

    config: CompanionConfig
    own: Source
    fleet: FleetFrame
    world: World
    pilot: Pilot
    times: PlanTimes


class CertifiedAvoidance:
    """``Avoidance`` by the committed plans of one vehicle.

    A committed plan is flown as it is: the limits of plans are not lowered, and no method of the field takes
    part. Set-points are compensated as ``tracking`` says; that changes no plan and no distance.
    """

    failing: int | None = None
    state = Holding.FRESH

    def __init__(self, parts: VehicleParts) -> None:
        self._config, own, fleet, self._world, self._pilot, self._times = parts
        self._flight = CertifiedFlight(self._config, own, fleet)
        self.lookahead_s = self._flight.lookahead_s
        self.tracking = PlanTracking(self._config.tracking)
        self.horizon: Horizon | None = None
        self.log = PlanLog()
        self.next_due = 0
        self._plans = 0
        self._finishing = False
        self._next_observation = 0
        self._waits_since: int | None = None
        self._rests_since: int | None = None

    @property
    def held(self) -> int:
        """Number of epochs for which the plan was carried on."""
        return sum(self._flight.commitment.held.values())

    @property
    def tally(self) -> Tally:
        """Counters for the summary."""
        commitment, times = self._flight.commitment, self._times
        failures = commitment.held[HoldReason.UNSOLVED]
        counts = self._plans, 0, failures, self.held, commitment.anchored_anew
        return Tally(*counts, times.plan_ns[:], times.plan_at[:], left_tube=self._flight.tube.left)

    def refused(self, now: int) -> RefusedSenders:
        """Return the senders whose committed plans are refused at ``now`` (µs)."""
        agreements = self._flight.agreements
        refused = agreements.refused_senders(now)
        wrong = self._flight.clocks.wrong & agreements.peers.members
        return refused._replace(wrong_clock=tuple(sorted(wrong.union(refused.wrong_clock))))

    def shed(self) -> None:
        """Do nothing: the log is empty."""

    def use(self, methods: tuple[MethodName, ...]) -> None:
        """Do nothing: committed plans use no methods."""

    def keep(self, lowered: Lowered) -> None:
        """Bound what set-points add to the plan; the limits of plans are those of the configuration."""
        self.tracking.keep(lowered.acceleration)

    def begin(self, now: int, measured: Motion) -> None:
        """Hold the ``measured`` position, or continue the committed plan, see ``CertifiedFlight.stand``.

        Without a plan, nothing begins before the vehicle rests: it may fly a plan of this companion's
        predecessor, on which the others rely and which the backup node sends to its end. That end is reached
        after ``lookahead_s`` at the latest.
        """
        if self._may_begin(now, measured):
            self._flight.stand(now, measured.position)

    def _may_begin(self, now: int, measured: Motion) -> bool:
        """Return whether there is a plan, the vehicle has rested for ``_REST_US``, or waited long enough."""
        if self._flight.commitment.current is not None:
            return True
        self._waits_since = now if self._waits_since is None else self._waits_since
        self._watch_rest(now, measured.velocity)
        rested = self._rests_since is not None and now - self._rests_since >= _REST_US
        return rested or now - self._waits_since >= 1e6 * self.lookahead_s

    def park(self, now: int, measured: Motion, stance: Stance) -> None:
        """Hold the column of a vehicle on the ground, or one that climbs, see ``CertifiedFlight.park``."""
        joins = stance is not Stance.PARKED
        self._flight.park(now, measured, joins=joins, climbs=stance is Stance.CLIMBS)

    def wait(self, now: int) -> str:
        """Return what is missing for the reservation of the column; an empty string: nothing."""
        waits = self._pilot.stance in (Stance.JOINS, Stance.CLIMBS, Stance.LOWERS)
        return self._flight.reservation.missing(now) if waits else _NOT_ASKED

    @property
    def parked(self) -> bool:
        """Whether the vehicle has a column on the ground and takes no part."""
        flight = self._flight
        return self._pilot.stance.grounded and flight.commitment.column and not flight.reservation.joined

    @property
    def enclosed(self) -> bool:
        """Whether fixed obstacles leave no way to the destination."""
        return self._flight.enclosed

    def pause(self, gap: int) -> None:
        """Do nothing: a committed plan stays valid."""

    def _watch_rest(self, now: int, velocity: Array | None) -> None:
        """Record since when the vehicle has been at rest."""
        if velocity is None or float(abs(velocity).max()) >= _REST_SPEED:
            self._rests_since = None
        elif self._rests_since is None:
            self._rests_since = now

    def discard(self) -> None:
        """Discard the horizon that is flown."""
        self.horizon = None

    def rest(self, now: int, velocity: Array | None) -> None:
        """Discard the horizon and the state of tracking, because set-points do not steer the vehicle."""
        self.horizon = None
        self.tracking.reset()
        self._watch_rest(now, velocity)

    def finish(self) -> None:
        """Make no further plan: the committed one is flown to its end, and then its last position held."""
        self._finishing = True

    def rests(self, now: int) -> bool:
        """Return whether nothing is flown, or the committed plan is at rest at ``now`` (µs)."""
        return self.horizon is None or now >= rest_time(self.horizon)

    def fly(self, now: int, situation: AvoidanceInputs) -> Array | None:
        """Bring the committed plan up to date.

        Returns its positions (N + 1, 3), m, of the next steps when the yaw is due, otherwise None.
        """
        flight = self._flight
        if self._finishing:
            flight.commitment.turn(now)
        elif not self._pilot.guided and flight.commitment.current is not None:
            flight.stand(now, situation.measured.position)
        if self._pilot.guided and not situation.stale:
            flight.watch(now, situation.measured)
        if self._config.tracking.compensate:
            self._observe(now, situation)
        if self._pilot.guided and not self._finishing:
            lowers = self._pilot.stance is Stance.LOWERS
            if lowers and flight.lower(now):
                pass
            elif flight.commitment.column:
                flight.leave_column(now, situation.measured, flies=self._pilot.vehicle.cruises)
            elif flight.due(now):
                self._replan(now, situation)
        self.horizon = horizon = flight.horizon()
        if horizon is None or now < self.next_due:
            return None
        self.next_due = now + self._config.rates.replan_us
        step, count = self._config.horizon.dt_us, self._config.horizon.steps + 1
        return horizon.positions(now + step, count, step)

    def idle(self, now: int) -> bool:
        """Return whether no plan, no announcement and no yaw plan is due at ``now`` (µs)."""
        return now < self.next_due and self._flight.idle(now)

    def receive(self, now: int, link: str, message: Message) -> bool:
        """Receive TUNNEL (plans, agreements) and TIMESYNC of the swarm link; return False for others."""
        if link != "swarm" or not isinstance(message, Tunnel | Timesync):
            return False
        self._flight.receive(now, message)
        return True

    def messages(self, now: int, *, farewell: bool) -> list[Message]:
        """Return the announcements of the committed plan and the requests for the others' clocks.

        A ``farewell`` of a vehicle that does not fly its last plan to the end is that of a landing.
        """
        if farewell and not self._finishing:
            self._flight.descend(now)
        return self._flight.messages(now, farewell=farewell)

    def recall(self) -> bool:
        """Carry the plan on in place of the one that the last messages announced, which are not sent.

        Returns False if that is not possible, see ``CertifiedFlight.recall``.
        """
        return self._flight.recall()

    def shared(self, now: int, view: View) -> Horizon | None:
        """Return None: committed plans have messages of their own."""
        return None

    def _observe(self, now: int, situation: AvoidanceInputs) -> None:
        """Update the compensation, once a set-point, with how the vehicle follows the plan."""
        tracking, horizon, loop = self.tracking, self._flight.horizon(), self._pilot.limits.loop
        if not self._pilot.guided:
            tracking.reset()
        elif situation.stale:
            tracking.forget()
        elif horizon is not None and loop is not None and now >= self._next_observation:
            self._next_observation = now + self._config.rates.setpoint_us
            tracking.follow(now, horizon, situation.measured, loop)

    def _replan(self, now: int, situation: AvoidanceInputs) -> None:
        """Make the next epoch's plan: by solving, from the measured motion, or by carrying the old one on."""
        flight, started = self._flight, self._times.stopwatch()
        aim = None if situation.stale else situation.aim()
        if aim is None:
            flight.commitment.carry_on(HoldReason.MISSING)
        elif flight.tube.lost:
            flight.anchor(now, situation.measured)
        else:
            self._plans += flight.plan(now, aim, self._world, situation.view)
        self._times.add(now, started)
