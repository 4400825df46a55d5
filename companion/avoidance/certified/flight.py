"""Certified mode of one companion: receives and announces plans, and decides when to make the next one."""

from __future__ import annotations

import numpy as np

from companion.avoidance.certified.clocks import ClockWatch
from companion.avoidance.certified.commitment import Commitment, HoldReason
from companion.avoidance.certified.constraint_sources import ConstraintSources
from companion.avoidance.certified.deadlock import DeadlockTurn
from companion.avoidance.certified.peer_plans import PeerPlans
from companion.avoidance.certified.qp import Objective, SeparationQp
from companion.avoidance.field.planner import Aim
from companion.config import CompanionConfig
from companion.values.horizon import Array, Horizon, Motion
from companion.world import View, World
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Message, Source, Timesync, Tunnel
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, pack
from mavlink_bridge.wire.roster import PAYLOAD_TYPE as ROSTER
from mavlink_bridge.wire.roster import Roster
from mavlink_bridge.wire.roster import pack as pack_roster
from mavlink_bridge.wire.roster import unpack as unpack_roster

_TURNING_SENSES = {"left": -1.0}


class CertifiedFlight:
    """Certified mode of one vehicle: its committed plan, the peers' plans and the constraint sources."""

    def __init__(self, config: CompanionConfig, own: Source, fleet: FleetFrame) -> None:
        certified, steps = config.certified, config.horizon.steps + 1
        self._config, self._own = config, own
        program = SeparationQp(
            steps, config.limits.within(config.field.margin(1)), certified, planar=config.planar
        )
        self._deadlock_turn = DeadlockTurn(
            certified.deadlock, program.gradient_per_metre, _TURNING_SENSES.get(config.turning_sense, 1.0)
        )
        self.commitment = Commitment(
            certified, program, self._deadlock_turn, fleet.fingerprint, planar=config.planar
        )
        self.peers = PeerPlans(
            own.system,
            frozenset(certified.fleet),
            steps,
            certified.dt_us,
            certified.epoch_us,
            fleet.fingerprint,
        )
        self.clocks = ClockWatch(own, certified.clock_us)
        self._replies: list[Timesync] = []
        self._sources = ConstraintSources(config, steps)
        seconds = 1e-6 * certified.dt_us * np.arange(1.0, steps + 1.0)
        self._before_end: Array = seconds - seconds[-1]
        self._steps = steps
        self.deviation = self.largest_deviation = 0.0
        """Distance (m) of the vehicle from its plan: ``deviation`` now, ``largest_deviation`` at most."""
        self.left_tube = 0
        """Number of times that the vehicle left the tube."""
        self._outside = self._in_control = self._announced = False
        self._polled_at: int | None = None
        self._next_announcement = 0
        self.lookahead_s = float(seconds[-1]) + 1e-6 * certified.epoch_us
        """Time (s) from now to the end of the plan that is made next, at most."""

    def receive(self, now: int, message: Tunnel | Timesync) -> None:
        """Receive a TUNNEL or TIMESYNC of the swarm link; count rosters that cannot be decoded as refused."""
        system = message.source.system
        if isinstance(message, Timesync):
            self._replies += self.clocks.receive(now, message)
            return
        if message.payload_type == PAYLOAD_TYPE:
            self.peers.receive_plan(now, system, message.payload)
        elif message.payload_type == ROSTER:
            try:
                self.peers.receive_roster(now, system, unpack_roster(message.payload))
            except PlanWireError:
                self.peers.refused += 1

    def stand(self, now: int, position: Array) -> None:
        """While not in control, continue the committed plan, or hold ``position`` (3,), m.

        The committed plan continues if the vehicle is within ``certified.tube`` (m) of it, or if it is
        announced for this epoch or a later one, because others rely on it. Otherwise a plan at rest at
        ``position`` begins, which is not announced before the companion is in control; ``anchored_anew``
        counts this if a plan had been announced.
        """
        self._polled_at = now
        commitment, horizon = self.commitment, self.commitment.horizon()
        if horizon is not None:
            difference = horizon.at(now).position - position
            inside = float(difference @ difference) <= self._config.certified.tube**2
            if inside or commitment.announced_until >= commitment.epoch(now):
                commitment.turn(now)
                return
        commitment.begin(now, position)
        commitment.anchored_anew += self._announced
        self._in_control = self._announced = False

    def due(self, now: int) -> bool:
        """Begin the next epoch if it is time; return True if ``plan`` is to be called for it now.

        That is when no member's clock is wrong and ``peers.missing`` is empty. Otherwise the result is False,
        and at the last call (``Commitment.last_call``) the committed plan is continued for an epoch.
        """
        self._polled_at, self._in_control = now, True
        if not self.commitment.turn(now):
            return False
        wrong = not self.clocks.wrong.isdisjoint(self.peers.members)
        if not wrong and not self.peers.missing(self.commitment.epoch(now)):
            return True
        if self.commitment.last_call(now):
            self.commitment.carry_on(HoldReason.CLOCK if wrong else HoldReason.MISSING)
        return False

    def watch(self, now: int, measured: Motion) -> None:
        """Record how far the vehicle is from its plan.

        Outside the tube the guarantee is suspended; the plan stays, because the autopilot returns to it.
        """
        horizon = self.commitment.horizon()
        if horizon is None:
            return
        difference = horizon.at(now).position - measured.position
        self.deviation = float(np.sqrt(difference @ difference))
        self.largest_deviation = max(self.largest_deviation, self.deviation)
        outside = self.deviation > self._config.certified.tube
        self.left_tube += outside and not self._outside
        self._outside = outside

    @property
    def lost(self) -> bool:
        """Whether the vehicle is further than ``guard.tube`` (m) from its plan: planning then begins anew."""
        return self.deviation > self._config.guard.tube

    def plan(self, now: int, aim: Aim, world: World, view: View) -> bool:
        """Make the next epoch's plan towards ``aim``; return False if the committed plan continues.

        ``aim.destination`` is where the plan should end.
        """
        commitment = self.commitment
        start = commitment.start()
        own = commitment.own()
        others, field = self._sources.around(now, commitment.epoch(now), own, self.peers, world, view)
        goal = self._deadlock_turn.turned(start.position_m, aim.destination)
        places = goal + self._before_end[:, None] * aim.velocity
        objective = Objective(places, np.broadcast_to(aim.velocity, places.shape), field)
        return commitment.replan(objective, aim.destination, others)

    def idle(self, now: int) -> bool:
        """Return whether there is nothing to make or to announce until something else is due."""
        following = self.commitment.following
        waiting = following is not None and now < following.epoch and now < self._next_announcement
        return waiting and not self._replies

    def horizon(self) -> Horizon | None:
        """Return the horizon that is flown; None without a plan."""
        return self.commitment.horizon()

    def messages(self, now: int, *, farewell: bool = False) -> list[Message]:
        """Return the messages for the swarm link now.

        They are TIMESYNC messages, and the newest plan with its roster (the present coordination set), at
        once and then every ``repeat_us``. ``farewell``: the vehicle makes no further plan; the roster says so
        once the vehicle flies the last one. Without ``farewell``, call ``due`` or ``stand`` at ``now`` first:
        otherwise the vehicle counts as not in control, and no plan is announced.
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
            return sync
        if announced.epoch == self.commitment.announced_until and now < self._next_announcement:
            return sync
        self.commitment.announced_until = announced.epoch
        self._next_announcement = now + self._config.certified.repeat_us
        self._announced = True
        if farewell:
            self.peers.leave(announced.epoch)
        roster = Roster(announced.epoch, self.peers.members, farewell)
        return [
            *sync,
            Tunnel(self._own, 0, 0, PAYLOAD_TYPE, pack(announced)),
            Tunnel(self._own, 0, 0, ROSTER, pack_roster(roster)),
        ]
