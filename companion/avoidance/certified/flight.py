"""Certified mode of one companion: receives and announces plans, and decides when to make the next one."""

from __future__ import annotations

from math import hypot

import numpy as np

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.announcements import Announcements
from companion.avoidance.certified.clocks import ClockWatch
from companion.avoidance.certified.columns import Distances
from companion.avoidance.certified.commitment import Commitment, HoldReason
from companion.avoidance.certified.committed import controls, rest_time
from companion.avoidance.certified.constraint_sources import ConstraintSources
from companion.avoidance.certified.deadlock import DeadlockTurn
from companion.avoidance.certified.fingerprint import identity
from companion.avoidance.certified.fixed_surfaces import FixedSurfaces
from companion.avoidance.certified.margins import beside, further
from companion.avoidance.certified.negotiation import Geometry
from companion.avoidance.certified.peer_plans import StoredPlan
from companion.avoidance.certified.places import Places
from companion.avoidance.certified.plan_goals import PlanGoals
from companion.avoidance.certified.plan_sides import plan_sides
from companion.avoidance.certified.qp import Objective, SeparationQp
from companion.avoidance.certified.reservation import Reservation
from companion.avoidance.certified.told_goals import ToldGoals
from companion.avoidance.certified.tube_watch import TubeWatch
from companion.avoidance.certified.vicinity import Vicinity
from companion.avoidance.certified.way_obstacles import WayObstacles
from companion.avoidance.field.planner import Aim
from companion.config import CompanionConfig
from companion.values.horizon import Array, Horizon, Motion
from companion.world import View, World
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Message, Source, Timesync, Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import unpack as unpack_statement
from mavlink_bridge.wire.goal import PAYLOAD_TYPE as GOAL
from mavlink_bridge.wire.plan import PAYLOAD_TYPE

_TURNING_SENSES = {"left": -1.0}
_STOOD_US = 1_000_000
"""Time (µs) within the tube of a plan at rest after which a vehicle that another controller flies stands."""


class CertifiedFlight:
    """Certified mode of one vehicle: its committed plan, the agreements and the constraint sources."""

    def __init__(self, config: CompanionConfig, own: Source, fleet: FleetFrame) -> None:
        certified, steps = config.certified, config.horizon.steps + 1
        self._config = config
        program = SeparationQp(
            steps, config.limits.within(config.field.margin(1)), certified, planar=config.planar
        )
        sense = _TURNING_SENSES.get(config.turning_sense, 1.0)
        self._deadlock_turn = DeadlockTurn(certified.deadlock, sense)
        self.commitment = Commitment(
            certified,
            program,
            self._deadlock_turn,
            fleet.fingerprint,
            planar=config.planar,
            sides=plan_sides(config),
        )
        self._vicinity = None if certified.range is None else Vicinity(config)
        self._listens_since: int | None = None
        self._last_step = 0
        fixed = FixedSurfaces(config)
        self._sources = ConstraintSources(config, steps, fixed)
        self._told = ToldGoals(own, fleet.fingerprint)
        obstacles = WayObstacles(config, fixed)
        self._places = Places(config, own.system, self._told, obstacles)
        downwash, between = config.field.downwash, self._sources.between
        distances = Distances(
            between,
            further(certified),
            planar=config.planar,
            downwash=downwash,
            shift=config.plane_shift,
        )
        self.agreements = Agreements(
            own.system,
            certified,
            steps,
            identity(config, fleet),
            Geometry(distances.apart, distances.agreed),
            None if self._vicinity is None else self._beyond,
        )
        self.reservation = Reservation(
            certified, self.commitment, self.agreements, beside(certified, config.field, config.limits)
        )
        self._announcements = Announcements(
            own, certified, self.commitment, self.agreements, self.reservation, self._told
        )
        self.clocks = ClockWatch(own, certified.clock_us)
        self._column_within = max(config.guard.tube, certified.drift)
        # The feed-forward of set-points needs the next plan before the lag of the attitude reaches it.
        self._lead = certified.epoch_us if config.tracking.compensate else certified.lead_us
        self._replies: list[Timesync] = []
        self._seconds: Array = 1e-6 * certified.dt_us * np.arange(1.0, steps + 1.0)
        self.tube = TubeWatch(config, self.commitment)
        self._goals = PlanGoals(
            config, own, self.agreements, obstacles, self._told, self._deadlock_turn, sense
        )
        self._in_control = self._received = False
        self._prepared, self._begun_at = False, 0
        self._polled_at: int | None = None
        self._place: tuple[int, Array | None] | None = None
        self.lookahead_s = float(self._seconds[-1]) + 1e-6 * certified.epoch_us
        """Time (s) from now to the end of the plan that is made next, at most."""

    def receive(self, now: int, message: Tunnel | Timesync) -> None:
        """Receive a TUNNEL or TIMESYNC of the swarm link; a statement that cannot be decoded is refused."""
        system = message.source.system
        if isinstance(message, Timesync):
            self._replies += self.clocks.receive(now, message)
            return
        if message.payload_type == PAYLOAD_TYPE:
            self.agreements.receive_plan(now, system, message.payload)
        elif message.payload_type == GOAL:
            try:
                self._told.receive(now, system, message.payload)
            except PlanWireError:
                self.agreements.refused += 1
            return
        elif message.payload_type == AGREEMENTS:
            try:
                self.agreements.receive_statement(now, system, unpack_statement(message.payload))
            except PlanWireError:
                self.agreements.refused += 1
        else:
            return
        self._received = True

    def stand(self, now: int, position: Array) -> None:
        """While not in control, continue the committed plan, or hold ``position`` (3,), m.

        The committed plan continues if the vehicle is within ``certified.tube`` (m) of it, or if it is
        announced for this epoch or a later one, because others rely on it. A column continues at the height
        of ``position``, unless another controller has flown the vehicle far from it. Otherwise a plan at rest
        at ``position`` begins, which is not announced before the companion is in control; ``anchored_anew``
        counts this if a plan had been announced. The column of a vehicle that was parked does not continue:
        it may be nearer to the others' plans than an agreement in the air allows. The same applies to one
        that was never reserved, of a vehicle that was not in control or has said farewell, as after a landing
        without a reservation: beside a nearer plan it could neither be agreed on nor left.
        """
        self._polled_at = now
        returns = self.agreements.rejoin()
        commitment, horizon = self.commitment, self.commitment.horizon()
        reserved = self.reservation.was_reserved and (self.reservation.joined or self._in_control)
        alone = commitment.column and not reserved and (returns or not self._in_control)
        if horizon is not None and not alone:
            difference = horizon.at(now).position - position
            if commitment.column:
                self._hover(position[2])
                if hypot(difference[0], difference[1]) <= self._column_within:
                    self._hold_column(now)
                    return
            inside = float(difference @ difference) <= self._config.certified.tube**2
            if inside or (commitment.announced_until >= commitment.epoch(now) and not commitment.column):
                commitment.turn(now)
                if inside and not self._prepared and now - self._begun_at >= _STOOD_US:
                    self._prepare()
                return
        self.agreements.begin(commitment.begin(now, position))
        self._begun_at = now
        if horizon is None:
            self._prepare()
            # Without a plan the vehicle rests. It may fly elsewhere later: there once more.
            self._prepared = False
        self.reservation.watch(now)
        commitment.anchored_anew += self._announcements.begin()
        self._in_control = False

    def park(self, now: int, measured: Motion, *, joins: bool, climbs: bool = False) -> None:
        """Hold the column of a vehicle that stands on the ground, or ``climbs`` by its autopilot.

        ``joins``: it is to take off; otherwise it is parked, and ``messages`` must say farewell.
        """
        if climbs:
            self.watch(now, measured)
        else:
            self.reservation.begin(now, measured.position, joins=joins)
        if self.reservation.joined:
            self._hold_column(now)
        else:
            self._in_control = False
            self.commitment.turn(now)

    def lower(self, now: int) -> bool:
        """Make the committed plan a column, carried on, for the landing; return False if it is to fly on.

        That is where another's plan is too near.
        """
        room = self.reservation.has_room()
        if room:
            self._hold_column(now)
        return room

    def descend(self, now: int) -> None:
        """Make the last plan a column, carried on: the autopilot lands the vehicle, reserved or not.

        Without a reservation others may be above or below; from now on they keep what a column needs.
        """
        if self.commitment.turn(now) and not self.commitment.column:
            self.commitment.raise_column()

    def leave_column(self, now: int, measured: Motion, *, flies: bool) -> None:
        """Make the column a plan in space again, at the height of the vehicle.

        That is once the autopilot reports that it ``flies``, neither takes off nor lands, the vehicle is
        within its tube, and each member has an agreement, or cannot meet it (``Reservation.may_be_left``).
        """
        commitment = self.commitment
        self._hover(measured.position[2])
        horizon = commitment.horizon()
        if self._hold_column(now) and horizon is not None and flies and self.reservation.may_be_left():
            off = horizon.at(now).position - measured.position
            inside = float(off @ off) <= self._config.certified.tube**2
            if inside and now >= rest_time(horizon):
                commitment.leave_column()
                # Its reservation ends here, also if the next step makes the plan a column again.
                self.reservation.watch(now)
                self._prepare()

    def _prepare(self) -> None:
        """Work out what ways need at the height of the newest plan, while the vehicle holds its place."""
        self._prepared = True
        newest = self.commitment.announced()
        if newest is not None:
            self._goals.prepare(float(controls(newest)[-1, 2, 2]))

    def _hover(self, height: float) -> None:
        """Fly the column at ``height`` (m), while all agreements that are kept have upright planes."""
        if self.reservation.columns.on_columns():
            self.commitment.hover(height)

    def _hold_column(self, now: int) -> bool:
        """Continue the plan, as a column; return whether the plan of the next epoch was made now."""
        self._told.tell(None)
        turned = self._take_part(now)
        if turned:
            self.commitment.raise_column()
        self.reservation.watch(now, listens=self._listens(now))
        return turned

    def due(self, now: int) -> bool:
        """Begin the next epoch if it is time; return True if ``plan`` is to be called for it now.

        That is ``lead_us`` before the end of the epoch, or with compensation at its beginning, when no
        member's clock is wrong and there is an agreement with each member: what is known late in the epoch
        still counts. If an agreement on the newest plans is about to be made, the plan waits for it until the
        last call (``Commitment.last_call``). Without an agreement with a member, the committed plan is
        continued for an epoch at the last call.
        """
        turned = self._take_part(now)
        self.reservation.watch(now)
        if not turned:
            return False
        wrong = not self.clocks.wrong.isdisjoint(self.agreements.peers.members)
        if wrong or self.agreements.missing() or self._listens(now):
            if self.commitment.last_call(now):
                self._told.ask_no_room()
                self.commitment.carry_on(HoldReason.CLOCK if wrong else HoldReason.MISSING)
            return False
        epoch = self.commitment.epoch(now)
        if now + self._lead < epoch + self._config.certified.epoch_us:
            return False
        return self.commitment.last_call(now) or not self.agreements.outdated(now, epoch)

    def _beyond(self, now: int, plan: StoredPlan) -> bool:
        """Return whether ``plan`` shows that its vehicle is beyond the range at ``now`` (µs)."""
        if self._vicinity is None:
            return False
        if self._place is None or self._place[0] != now:
            horizon = self.commitment.horizon()
            self._place = now, None if horizon is None else horizon.at(now).position
        place = self._place[1]
        return place is not None and self._vicinity.beyond(now, place, plan)

    def _listen(self, now: int) -> None:
        """Note since when (µs) the companion has listened without a gap."""
        gap = self._config.certified.contact_us + self._config.certified.epoch_us
        if self._listens_since is None or now - self._last_step > gap:
            self._listens_since = now
        self._last_step = now

    def _listens(self, now: int) -> bool:
        """Return whether the companion may have heard too little yet of who is within the range."""
        if self._vicinity is None or self._listens_since is None:
            return False
        return now - self._listens_since < 2 * self._config.certified.contact_us

    def _take_part(self, now: int) -> bool:
        """Fly the plan of this epoch and agree; return whether that of the next one is to be made."""
        self._polled_at, self._in_control = now, True
        self._listen(now)
        self.agreements.rejoin()
        turned = self.commitment.turn(now)
        if not (turned and self.commitment.unannounced):
            self._agree(now)
        return turned

    def _agree(self, now: int) -> None:
        """Take and propose agreements if a message was received or a plan was made."""
        announced = self.commitment.announced()
        if announced is None:
            return
        new = self.agreements.made(announced)
        if new or self._received:
            self._received = False
            self.agreements.update(now)

    def anchor(self, now: int, measured: Motion) -> None:
        """Plan anew from the ``measured`` motion; all agreements are void (``Commitment.anchor``)."""
        self._told.ask_no_room()
        self.agreements.begin(self.commitment.anchor(now, measured))

    def watch(self, now: int, measured: Motion) -> None:
        """Record how far the vehicle is from its plan (``TubeWatch.watch``)."""
        self.tube.watch(now, measured)

    @property
    def enclosed(self) -> bool:
        """Whether fixed obstacles leave no way from the end of the plan to the destination."""
        return self._goals.enclosed

    def plan(self, now: int, aim: Aim, world: World, view: View) -> bool:
        """Make the next epoch's plan towards ``aim``; return False if the committed plan continues.

        ``aim.destination`` is where the plan should end.
        """
        commitment = self.commitment
        start = commitment.start()
        own = commitment.own()
        epoch = commitment.epoch(now)
        destination = self._places.destination(now, epoch, own[-1, 2], aim, self.agreements.peers)
        given = aim.given and destination is aim.destination
        moving = aim.path is not None
        subgoal, goal = self._goals.chosen(now, epoch, start, own, destination, given=given, moving=moving)
        others, field = self._sources.around(now, epoch, own, goal, self.agreements, world, view)
        objective = self._objective(1e-6 * (start.epoch - now), aim, goal, field)
        return commitment.replan(
            objective, subgoal, others, max(self.tube.outside, self.agreements.peers.outside)
        )

    def _objective(self, begins: float, aim: Aim, goal: Array, field: Array) -> Objective:
        """Return the preferred places of a plan that begins in ``begins`` s and should end at ``goal`` (3,).

        Those of a destination that moves are on its path, all shifted by the offset of ``goal`` from its end.
        """
        if aim.path is None:
            places = np.empty(field.shape)
            places[:] = goal
            return Objective(places, np.zeros(field.shape), field)
        positions, velocities = aim.path(begins + self._seconds)
        (end,), _ = aim.path(np.array([self.lookahead_s]))
        moving = float(aim.velocity @ aim.velocity) > self._config.certified.following.speed**2
        return Objective(positions + (goal - end), velocities, field, moving)

    def idle(self, now: int) -> bool:
        """Return whether there is nothing to make or to announce until something else is due."""
        following = self.commitment.following
        waiting = following is not None and now < following.epoch and now < self._announcements.next_at
        return waiting and not self._replies and not self._received and not self.agreements.changed

    def horizon(self) -> Horizon | None:
        """Return the horizon that is flown; None without a plan."""
        return self.commitment.horizon()

    def messages(self, now: int, *, farewell: bool = False) -> list[Message]:
        """Return the messages for the swarm link now.

        They are TIMESYNC messages; the newest plan with a statement of all agreements, at once and then every
        ``repeat_us``, or more often in heavy loss (``Repetition``); and a statement of the agreements that
        changed. ``farewell``: the vehicle makes no further plan; the statement says so once the vehicle flies
        the last one. Without ``farewell``, call ``due`` or ``stand`` at ``now`` first: otherwise the vehicle
        counts as not in control, and no plan is announced.
        """
        sync: list[Message] = [*self._replies, *self.clocks.due(now)]
        self._replies.clear()
        if farewell:
            self.commitment.turn(now)
            farewell = self.commitment.following is None
        elif self._polled_at != now:
            self._in_control = False
        announced = self.commitment.announced()
        if announced is None or not (self._in_control or farewell):
            return [*sync, *self._announcements.away(now)]
        self._agree(now)
        return [*sync, *self._announcements.messages(now, announced, self.tube.outside, farewell=farewell)]

    def recall(self) -> bool:
        """Take back what the last ``messages`` announced; return whether that was possible.

        Call it if these messages are not sent (``Announcements.recall``).
        """
        return self._announcements.recall()
