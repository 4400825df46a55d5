"""A swarm of points that are where their plans say, each with the certified mode of a companion, on a channel
that loses, delays, repeats and reorders."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from heapq import heappop, heappush
from itertools import combinations, count
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.agreed_planes import AgreedPlanes
from companion.avoidance.certified.committed import carried_on, controls, horizon_of, resting
from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.certified.margins import between, further
from companion.avoidance.certified.pair import Agreement
from companion.avoidance.certified.separating_planes import hull_distance, nearest
from companion.avoidance.field.planner import standing
from companion.config import CompanionConfig
from companion.config.certified import CertifiedConfig
from companion.config.planning import LimitsConfig
from companion.values.components import COMPONENT
from companion.values.horizon import Array, Motion
from companion.world import View, World
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Source, Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import unpack
from mavlink_bridge.wire.plan import WirePlan, pack
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS, curves

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
TICK = 20_000
NEVER = 1 << 62
EXACT = 1e-9
"""m."""
CLIMB = 800_000
"""µs."""
_NOTHING = View(None, None, None, None)


def within(since: int, spans: tuple[tuple[int, int], ...]) -> bool:
    return any(begin <= since < end for begin, end in spans)


class Rough(NamedTuple):
    """How a channel treats messages: share lost, longest delay (µs), share sent twice; who is cut off from
    all others from when till when (µs of the run); who hears nothing; from when till when nobody hears whom,
    or only its plans. ``again``: µs after which each message arrives once more, 0 for never."""

    loss: float = 0.0
    delay: int = 0
    twice: float = 0.0
    cuts: tuple[tuple[int, int, frozenset[int]], ...] = ()
    deaf: frozenset[int] = frozenset()
    mute: tuple[tuple[int, int, int], ...] = ()
    alone: tuple[tuple[int, int, int], ...] = ()
    again: int = 0
    reach: float = np.inf
    """Largest distance (m) of the places on plans at which a message that is sent arrives."""


class Habits(NamedTuple):
    """Of one vehicle, µs of the run: when it is switched on, when it steers from, when it leaves; when it is
    not called, and when it may not steer (from, till); how far its clock is ahead. Until it steers it wanders
    about its place by ``wanders`` m; on the ground only its estimate does. When it ``returns`` it joins again
    where it is. When its companion ``restarts`` it has forgotten everything, and begins anew where the
    vehicle is. One that ``takes_off`` stands on the ground below its place before, and climbs for ``CLIMB``;
    one that ``lands`` stays down."""

    on: int = 0
    steers: int = 0
    leaves: int = NEVER
    frozen: tuple[tuple[int, int], ...] = ()
    released: tuple[tuple[int, int], ...] = ()
    ahead: int = 0
    wanders: float = 0.0
    returns: int = NEVER
    restarts: int = NEVER
    takes_off: int = -1
    lands: int = NEVER


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


class Kept(NamedTuple):
    """That ``system`` keeps ``agreement`` with ``other`` with its plan of ``epoch`` (µs)."""

    system: int
    other: int
    agreement: Agreement
    epoch: int


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
        flight, commitment = self.flight, self.flight.commitment
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
        # Before its first plan, a companion that has restarted flies what the one before has told.
        first = flight.agreements.since if self._restarted else 0
        for plan in (commitment.current, commitment.following):
            if plan is not None and plan.epoch >= first and (self.plans or messages):
                self.contradictions += self.plans.setdefault(plan.epoch, plan) != plan
        return [message for message in messages if isinstance(message, Tunnel)]

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
            left = {system: last.plan for system, last in flight.agreements.left.items()}
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
        return system in self.flight.agreements.members - self.flight.agreements.missing()

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


class Swarm:
    """``starts`` (k, 3) m; systems are 1…k, and all expect each other unless ``strangers``."""

    def __init__(
        self,
        starts: Array,
        rough: Rough,
        habits: Sequence[Habits],
        seed: int,
        *,
        epoch: int = DT,
        strangers: bool = False,
        others: Mapping[int, Mapping[str, object]] | None = None,
        planar: bool = False,
        settings: Mapping[str, object] | None = None,
        v_max: tuple[float, float, float] | None = None,
        more: Mapping[str, object] | None = None,
    ) -> None:
        """``others``: other certified settings of some vehicles, by system id; ``settings``: of all.

        ``more``: other values of the companions' settings.
        """
        fleet = tuple(range(1, len(starts) + 1))
        expected: dict[str, object] = {
            "dt_us": DT,
            "epoch_us": epoch,
            # In space, too, where it is 0 by default: the laws are the same.
            "plane_shift": 0.75,
            "fleet": () if strangers else fleet,
        }
        certified = CertifiedConfig.model_validate({**expected, **(settings or {})})
        limits = LimitsConfig() if v_max is None else LimitsConfig(v_max=v_max)
        document: dict[str, object] = {"task": "goto", "avoidance": "certified", "turning_sense": "right"}
        document |= {"certified": certified, "planar": planar, "limits": limits, **(more or {})}
        self.config = CompanionConfig.model_validate(document)
        self.d = between(self.config.certified, self.config.field, self.config.limits)
        self._further = further(self.config.certified)
        self.vehicles = [
            Vehicle(system, self._config_of(others or {}, system), np.array(place), habit)
            for system, place, habit in zip(fleet, starts, habits, strict=True)
        ]
        self._rng, self._rough, self._serial = np.random.default_rng(seed), rough, count()
        self._phases = self._rng.integers(0, TICK, len(starts)).tolist()
        self.sent: list[bytes] = []
        self.parted: list[tuple[int, int, int]] = []
        """When (µs of the run) which two vehicles may plan without an agreement that both keep."""
        self.kept: set[Kept] = set()
        self.misled: list[tuple[int, int, int]] = []
        """When (µs of the run) who flies beside whose last plan although that has made another."""
        self.mistaken: list[Kept] = []
        """Agreements of which somebody holds other plans than those that are flown."""

    def _config_of(self, others: Mapping[int, Mapping[str, object]], system: int) -> CompanionConfig:
        certified = self.config.certified.model_copy(update=others.get(system, {}))
        return self.config.model_copy(update={"certified": certified})

    def run(self, until: int, goals: Callable[[int, int], Array]) -> None:
        """From the beginning until ``until`` µs; ``goals`` by time and system."""
        order = sorted(zip(self._phases, self.vehicles, strict=True), key=lambda one: one[0])
        for tick in range(0, until, TICK):
            for phase, vehicle in order:
                since, habits = tick + phase, vehicle.habits
                if since < habits.on or within(since, habits.frozen):
                    continue
                for message in vehicle.step(since, goals(since, vehicle.system)):
                    self.sent.append(message.payload)
                    self._carry(since, vehicle, message)
                self._record(since, vehicle)
                self._check(since, vehicle)

    def _record(self, since: int, one: Vehicle) -> None:
        newest = one.flight.commitment.announced()
        if newest is None or not one.plans:
            return
        if not one.habits.leaves <= since < one.habits.returns:
            left = one.flight.agreements.left.items()
            self.misled += [(since, one.system, s) for s, last in left if self._flies_another(s, last.plan)]
        for system, agreement, plans in one.keeps():
            kept = Kept(one.system, system, agreement, newest.epoch)
            if kept in self.kept:
                continue
            self.kept.add(kept)
            true = one.plans.get(agreement.own), self.vehicles[system - 1].plans.get(agreement.other)
            if (plans.own.plan, plans.other.plan) != true:
                self.mistaken.append(kept)

    def _check(self, since: int, one: Vehicle) -> None:
        own = one.flight.agreements.kept()
        for other in self.vehicles:
            theirs = other.flight.agreements.kept().get(one.system, ())
            mine = own.get(other.system, ())
            both = {a for a in mine if Agreement(a.other, a.own) in theirs}
            if one.confirmed(other.system) and other.confirmed(one.system) and not both:
                self.parted.append((since, one.system, other.system))

    def _carry(self, since: int, sender: Vehicle, message: Tunnel) -> None:
        rough, rng = self._rough, self._rng
        unreceived = rough.mute + (rough.alone if message.payload_type == AGREEMENTS else ())
        mute = any(begin <= since < end and sender.system == whom for begin, end, whom in unreceived)
        for receiver in self.vehicles:
            if receiver is sender or receiver.system in rough.deaf:
                continue
            ends = {sender.system, receiver.system}
            cut = any(begin <= since < end and len(ends & whom) == 1 for begin, end, whom in rough.cuts)
            cut |= rough.reach < np.inf and not self._within(since, sender, receiver)
            for _ in range(1 + bool(rng.random() < rough.twice)):
                arrives = since + 1 + int(rng.random() * rough.delay)
                if rng.random() >= rough.loss and not (cut or mute):
                    heappush(receiver.inbox, (arrives, next(self._serial), message))
                    if rough.again:
                        heappush(receiver.inbox, (arrives + rough.again, next(self._serial), message))

    def _within(self, since: int, one: Vehicle, two: Vehicle) -> bool:
        """Whether two vehicles are within reach at ``since`` (µs of the run), where their plans are."""
        now, step = EPOCH + since, self.config.certified.epoch_us
        places = [horizon_of(v.plan(now - now % step)).at(now).position for v in (one, two)]
        return bool(np.linalg.norm(places[0] - places[1]) <= self._rough.reach)

    def epochs(self) -> range:
        """All that anybody flew in."""
        step = self.config.certified.epoch_us
        known = [EPOCH, *(epoch for vehicle in self.vehicles for epoch in vehicle.plans)]
        return range(min(known), max(known) + 1, step)

    def least(self) -> float:
        """The least distance (m) of any two plans as they are flown, by hulls and by places along them.

        The distance is horizontal where autopilots decide on heights, and what is added for each such vehicle
        is not counted.
        """
        length = self.config.certified.epoch_us
        steps = length // self.config.certified.dt_us
        least = np.inf
        for epoch in self.epochs():
            since = epoch - EPOCH
            flown = [
                (vehicle.in_column(since, since + length), controls(vehicle.plan(epoch))[:steps])
                for vehicle in self.vehicles
            ]
            together = list(combinations(flown, 2))
            pairs = np.stack([one - other for (_, one), (_, other) in together])
            columns = np.array([one + other for (one, _), (other, _) in together])
            pairs[columns > 0, ..., 2] = 0.0
            more = np.repeat(self._further * columns, steps)
            pairs = pairs.reshape(-1, 3, 3)
            least = min(least, (hull_distance(pairs) - more).min())
            least = min(least, (np.linalg.norm(curves(pairs), axis=-1).min(axis=-1) - more).min())
        return float(least)

    def unflagged(self) -> bool:
        """Whether an autopilot decides on a height in an epoch whose plan is no column."""
        length = self.config.certified.epoch_us
        return any(
            vehicle.in_column(epoch - EPOCH, epoch - EPOCH + length) and not vehicle.plan(epoch).column
            for vehicle in self.vehicles
            for epoch in self.epochs()
        )

    def crossed(self) -> float:
        """By how much (m) plans cross the planes of agreements that are kept, at most; negative if none does.

        The planes are worked out anew from what is flown, by NumPy.
        """
        return max((self._crossed(kept) for kept in self.kept), default=-np.inf)

    def _crossed(self, kept: Kept) -> float:
        one, two = self.vehicles[kept.system - 1], self.vehicles[kept.other - 1]
        newest, own, other = (
            controls(carried_on(plan, (kept.epoch - plan.epoch) // plan.dt))
            for plan in (
                one.plans[kept.epoch],
                one.plans[kept.agreement.own],
                two.plans[kept.agreement.other],
            )
        )
        relative = own - other
        begins, travel = max(kept.agreement), np.zeros((2, 3))
        plans = one.plans[kept.agreement.own], two.plans[kept.agreement.other]
        for side, plan in enumerate(plans):
            points = controls(carried_on(plan, (begins - plan.epoch) // plan.dt))
            travel[side] = points[-1, 2] - points[0, 0]
        columns = sum(plan.column for plan in plans)
        if columns:
            relative[..., 2] = travel[:, 2] = 0.0
        motion = travel.sum(axis=0) / (1.0 + np.linalg.norm(travel, axis=1).sum())
        normals = nearest(relative)
        share = 0.5 * (1.0 - self.config.plane_shift * normals @ motion)[:, None]
        gap = np.minimum(self.d + columns * self._further, np.einsum("nk,nik->ni", normals, relative))
        least = np.einsum("nk,nik->ni", normals, own) - share * (
            np.einsum("nk,nik->ni", normals, relative) - gap
        )
        return float((least - np.einsum("nk,nik->ni", normals, newest)).max())

    @property
    def exact(self) -> float:
        """How exactly (m) distances are kept: two plans of an agreement on a column by 1 µm."""
        return EXACT + 1e-6 * any(vehicle.columns for vehicle in self.vehicles)

    def abandoned(self) -> list[Made]:
        """Plans that were made beside an agreement with another that is known to have begun anew since."""
        return [
            made
            for made in self.made()
            if any(one.other < made.begun.get(s, 0) for s, kept in made.beside.items() for one in kept)
        ]

    def _flies_another(self, system: int, last: WirePlan) -> bool:
        """Whether the newest plan of ``system`` is not ``last``, carried on."""
        vehicle = self.vehicles[system - 1]
        at = max(last.epoch, *vehicle.plans)
        return vehicle.plan(at) != carried_on(last, (at - last.epoch) // last.dt)

    def faults(self) -> list[str]:
        """What breaks the theorem, or a law that it follows from, in this run; each by its name."""
        found = {
            "separation": self.least() < self.d - self.exact,
            "a height without a column": self.unflagged(),
            "a height beside slanted planes": any(vehicle.slanted for vehicle in self.vehicles),
            "no agreement in common": bool(self.parted),
            "other plans than those that are flown": bool(self.mistaken),
            "a plan crosses a plane": self.crossed() > EXACT,
            "a plan beside an abandoned one": bool(self.abandoned()),
            "a last plan that is not flown on": bool(self.misled),
            "two plans of an epoch": any(vehicle.contradictions for vehicle in self.vehicles),
        }
        return [name for name, broken in found.items() if broken]

    def made(self) -> list[Made]:
        """By all, each in its own order."""
        return [made for vehicle in self.vehicles for made in vehicle.made]

    def digest(self) -> bytes:
        """All that was flown and told."""
        flown = [pack(vehicle.plan(epoch)) for vehicle in self.vehicles for epoch in self.epochs()]
        return b"".join(flown + self.sent)
