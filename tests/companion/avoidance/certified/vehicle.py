"""A point that is where its plans say, with the certified mode of a companion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from heapq import heappop
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.agreed_planes import AgreedPlanes
from companion.avoidance.certified.committed import carried_on, horizon_of, resting
from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.certified.pair import Agreement
from companion.avoidance.field.planner import standing
from companion.config import CompanionConfig
from companion.values.components import COMPONENT
from companion.values.horizon import Array, Motion
from companion.world import View, World
from mavlink_bridge.messages import Source, Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import unpack
from mavlink_bridge.wire.plan import PAYLOAD_TYPE as PLAN
from mavlink_bridge.wire.plan import WirePlan
from mavlink_bridge.wire.plan import unpack as unpack_plan
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS
from tests.companion.avoidance.certified.rough import CLIMB, FLEET, NEVER, Habits, within

_NOTHING = View(None, None, None, None)


class Made(NamedTuple):
    """A plan that was made, or tried to be made, at ``since`` (µs of the run) in ``epoch``: beside which
    agreements, and beside the last plans of those that said farewell, by system; and whether it was found."""

    system: int
    since: int
    epoch: int
    beside: Mapping[int, tuple[Agreement, ...]]
    left: Mapping[int, WirePlan]
    begun: Mapping[int, int]
    """Since when (µs) each other has begun anew, as this vehicle has heard."""
    found: bool


class Vehicle:
    """One of the swarm, as ``Companion`` handles its certified flight. ``plans``: what it flies, by epoch."""

    def __init__(self, system: int, config: CompanionConfig, place: Array, habits: Habits) -> None:
        self.system, self.place, self.habits = system, place, habits
        self._config = config
        self._start()
        self.world = World(config, system, 0, FLEET)
        self.plans: dict[int, WirePlan] = {}
        self.contradictions = 0
        """Plans that it flew or told and that were not the one it had told or flown for that epoch."""
        self.inbox: list[tuple[int, int, Tunnel]] = []
        self.made: list[Made] = []
        self.columns: list[list[int]] = []
        """From when till when (µs since ``EPOCH`` by its clock) its autopilot alone decides on its height."""
        self.slanted = False
        """Whether it kept planes that are not upright when its autopilot began to decide on its height."""
        self.busy_until = 0
        """Until when (µs of the run) its last step lasts."""
        self.stalled: list[tuple[int, int, WirePlan | None]] = []
        """From when till when (µs of the run) a step lasted that sent nothing, and its newest plan until
        then, which a backup node flies meanwhile; None: it has told none yet."""
        self._handles = self._fly if habits.takes_off < 0 else self._stand
        self._begun: dict[int, int] = {}

    def _start(self) -> None:
        self.flight = CertifiedFlight(self._config, Source(self.system, COMPONENT), FLEET)
        self._flying = self._restarted = False

    def step(self, since: int, goal: Array) -> list[Tunnel]:
        if since >= self.habits.restarts and not self._restarted:
            self._start()
            self._restarted = True
            # What arrived before is lost.
            while self.inbox and self.inbox[0][0] <= since:
                heappop(self.inbox)
        now = EPOCH + since + self.habits.ahead
        flight = self.flight
        while self.inbox and self.inbox[0][0] <= since:
            message = heappop(self.inbox)[2]
            if message.payload_type == AGREEMENTS:
                system, said = message.source.system, unpack(message.payload)
                # After a farewell the last plan is flown on, which keeps all that was agreed.
                told = not said.farewell and any(entry.peer == self.system for entry in said.entries)
                begun = said.since if told else 0
                self._begun[system] = max(self._begun.get(system, 0), begun)
            flight.receive(now, message)
        leaving = self.habits.leaves <= since < self.habits.returns
        if leaving or within(since, self.habits.released):
            self._flying = False
        else:
            self._handles(now, since, goal)
            standing_by = self._handles == self._stand and not flight.reservation.joined
            leaving = standing_by or self._handles == self._sink
        messages = flight.messages(now, farewell=leaving)
        return [message for message in messages if isinstance(message, Tunnel)]

    def stall(self, since: int) -> bool:
        """Let the step that began at ``since`` (µs of the run) last; return whether it sends nothing."""
        lasts = (end for begin, end in self.habits.stalls if begin <= since < end)
        self.busy_until = max(lasts, default=since)
        return self.busy_until > since and self.recall(since)

    def recall(self, since: int) -> bool:
        """Recall the step that began at ``since`` (µs of the run), see ``CertifiedFlight``."""
        recalled = self.flight.recall()
        if recalled:
            newest = self.plans[max(self.plans)] if self.plans else None
            self.stalled.append((since, self.busy_until, newest))
        return recalled

    def held(self, epoch: int) -> WirePlan | None:
        """The plan of ``epoch`` (µs) that it told or flew; None: none.

        In a step that lasted and sent nothing it carried the plan before on, which it may tell later.
        """
        since = epoch - EPOCH - self.habits.ahead
        if epoch not in self.plans and any(begin < since <= end for begin, end, _ in self.stalled):
            return self.plans.setdefault(epoch, self.plan(epoch))
        return self.plans.get(epoch)

    def note(self, sent: Sequence[Tunnel]) -> None:
        """Record what it flies after a step that ``sent`` these messages, and the plans among them."""
        commitment = self.flight.commitment
        # Before its first plan, a companion that has restarted flies what the one before has told.
        first = self.flight.agreements.since if self._restarted else 0
        told = [unpack_plan(message.payload) for message in sent if message.payload_type == PLAN]
        flown = (commitment.current, commitment.following) if self.plans or sent else ()
        for plan in (*told, *flown):
            if plan is not None and plan.epoch >= first:
                self.contradictions += self.plans.setdefault(plan.epoch, plan) != plan

    def _at(self, height: float) -> Motion:
        return Motion(np.array([*self.place[:2], height]), np.zeros(3), np.zeros(3))

    def may_move(self, now: int) -> bool:
        """Whether its autopilot may take it off or land it."""
        return not self.flight.reservation.missing(now)

    def _stand(self, now: int, since: int, goal: Array) -> None:
        stands = self._at(0.0)
        stands.position[:2] += self._wandered(since)[:2]
        self.flight.park(now, stands, joins=since >= self.habits.takes_off)
        if self.flight.reservation.joined and self.may_move(now):
            self._let_go(now)
            self._handles = self._climb

    def _climb(self, now: int, since: int, goal: Array) -> None:
        self.flight.park(now, self._at(0.5 * self.place[2]), joins=True, climbs=True)
        if now - EPOCH >= self.columns[-1][0] + CLIMB:
            self.flight.stand(now, self.place)
            self._flying, self._handles = True, self._level

    def _level(self, now: int, since: int, goal: Array) -> None:
        self.flight.leave_column(now, self._at(self.place[2]), flies=True)
        if not self.flight.commitment.column:
            step = self._config.certified.epoch_us
            self.columns[-1][1] = now - EPOCH + step - now % step
            self._handles = self._fly

    def _lower(self, now: int, since: int, goal: Array) -> None:
        if not self.flight.lower(now):
            if self.flight.commitment.column:
                self.flight.leave_column(now, self._flown(now), flies=True)
            else:
                self._steer(now, since, goal)
        elif self.may_move(now):
            self._let_go(now)
            self._handles = self._sink

    def _let_go(self, now: int) -> None:
        self.columns.append([now - EPOCH, NEVER])
        agreed = self.flight.agreements.agreed()
        self.slanted |= not all(plans.own.plan.column for plans in agreed)

    def _sink(self, now: int, since: int, goal: Array) -> None:
        self._flying = False

    def in_column(self, begin: int, end: int) -> bool:
        """Whether its autopilot decides on its height at any time in between (µs since ``EPOCH``)."""
        return any(one < end and begin < other for one, other in self.columns)

    def _fly(self, now: int, since: int, goal: Array) -> None:
        if since >= self.habits.lands:
            self._handles = self._lower
            self._lower(now, since, goal)
        else:
            self._steer(now, since, goal)

    def _flown(self, now: int) -> Motion:
        horizon = self.flight.horizon()
        assert horizon is not None
        return horizon.at(now)

    def _steer(self, now: int, since: int, goal: Array) -> None:
        flight, steers = self.flight, since >= self.habits.steers
        if not (self._flying and steers):
            flight.stand(now, self._here(now, since))
        self._flying = True
        if steers and flight.due(now):
            epoch = flight.commitment.epoch(now)
            beside = flight.agreements.kept()
            left = {system: last.plan for system, last in flight.agreements.peers.left.items()}
            found = flight.plan(now, standing(goal, None)._replace(given=True), self.world, _NOTHING)
            self.made.append(Made(self.system, since, epoch, beside, left, dict(self._begun), found))

    def _here(self, now: int, since: int) -> Array:
        epoch = self.flight.commitment.epoch(now)
        there = horizon_of(self.plan(epoch)).at(now).position if self.plans else self.place
        result: Array = there + self._wandered(since)
        return result

    def _wandered(self, since: int) -> Array:
        offset: Array = self.habits.wanders * np.sin(1e-6 * since * np.array([7.0, 5.0, 3.0]))
        return offset

    def confirmed(self, system: int) -> bool:
        """Whether it may plan beside ``system`` because of an agreement."""
        return system in self.flight.agreements.peers.members - self.flight.agreements.missing()

    def keeps(self) -> list[tuple[int, Agreement, AgreedPlanes]]:
        """The agreements that it keeps now, with whom, and what it takes for their plans."""
        agreements = self.flight.agreements
        named = [(system, one) for system, kept in sorted(agreements.kept().items()) for one in kept]
        return [(*one, plans) for one, plans in zip(named, agreements.agreed(), strict=True)]

    def plan(self, epoch: int) -> WirePlan:
        """What it flies in ``epoch``, called or not: its last plan goes on."""
        if not self.plans:
            # Never steered, never said anything: it stands there.
            place = self.place if self.habits.takes_off < 0 else self._at(0.0).position
            return resting(epoch, DT, STEPS, place, FLEET.fingerprint)
        last = max((known for known in self.plans if known <= epoch), default=min(self.plans))
        plan = self.plans[last]
        return carried_on(plan, max(epoch - last, 0) // plan.dt)
