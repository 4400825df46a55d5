"""Columns of air: nobody climbs or sinks by its autopilot before all others keep clear of its place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.columns import Distances
from companion.avoidance.certified.commitment import HoldReason
from companion.avoidance.certified.committed import resting
from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.certified.negotiation import Negotiation
from companion.avoidance.certified.reservation import Reservation
from companion.avoidance.certified.separating_planes import agreed_planes
from companion.config import CompanionConfig
from companion.config.certified import CertifiedConfig
from companion.values.components import COMPONENT
from companion.values.horizon import Array, Motion
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.messages import Source, Tunnel
from mavlink_bridge.wire.agreements import Statement, unpack
from mavlink_bridge.wire.plan import pack
from tests.companion.avoidance.certified.draws import delays, losses
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS
from tests.companion.avoidance.certified.swarm import CLIMB, FLEET, NEVER, Habits, Rough, Swarm, Vehicle
from tests.companion.avoidance.certified.two import LENGTH, NOW, OTHER, OWN, agreed, agreements, leaving, plan

CONFIG = CompanionConfig(avoidance="certified", certified=CertifiedConfig(dt_us=DT, epoch_us=DT))
UNTIL = 6_000_000
"""µs of a run."""
UP = np.array([0.0, 0.0, 1.0])
"""m."""
ROWS = 2.0
"""m between two places on the ground, which is little more than needed."""
FLIGHTS = settings(max_examples=20, suppress_health_check=[HealthCheck.too_slow])


def places(count: int, seed: int) -> Array:
    """A row of places (count, 3), m, at the heights to which they climb."""
    rng = np.random.default_rng(seed)
    row = np.array([[ROWS * k, 0.0, 5.0] for k in range(count)])
    return row + rng.uniform(-0.05, 0.05, (count, 3))


def wandering(count: int, seed: int) -> Callable[[int, int], Array]:
    """Goals above the row of places, now and then a new one: more often above each other than beside."""

    def goal(since: int, system: int) -> Array:
        rng = np.random.default_rng([seed, since // 1_500_000, system])
        place: Array = rng.uniform([-0.5, -0.7, 3.0], [ROWS * count - 1.5, 0.7, 9.0])
        return place

    return goal


def fly(habits: list[Habits], rough: Rough, seed: int, until: int = UNTIL) -> Swarm:
    swarm = Swarm(places(len(habits), seed), rough, habits, seed)
    swarm.run(until, wandering(len(habits), seed))
    return swarm


def lands(rng: np.random.Generator) -> int:
    return int(rng.choice([NEVER, 2_000_000 + int(rng.integers(0, 3_000_000))]))


def at_random(seed: int, rough: Rough) -> Swarm:
    """Some fly from the beginning, some take off, some land, at any time."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 4))
    habits = [Habits(lands=lands(rng), ahead=int(rng.integers(-5_000, 5_001))) for _ in range(count)]
    for k in range(count):
        if rng.random() < 0.6 or k == 0:
            habits[k] = habits[k]._replace(takes_off=int(rng.integers(0, 2_000_000)))
        if rng.random() < 0.2:
            begin = int(rng.integers(0, 5_000_000))
            habits[k] = habits[k]._replace(frozen=((begin, begin + int(rng.integers(20_000, 2_000_000))),))
    return fly(habits, rough, seed)


@FLIGHTS
@given(st.integers(0, 2**16), losses, delays)
@example(597, 0.0, 500_000)  # lands in the step after it has left the column of its take-off
def test_a_column_is_kept_whatever_happens(seed: int, loss: float, delay: int) -> None:
    """From the climb's beginning to its end, and from the landing's on, all plans are apart horizontally."""
    assert not at_random(seed, Rough(loss, delay, 0.2)).faults()


@pytest.mark.parametrize("rough", [Rough(), Rough(0.2, 100_000), Rough(0.6, 100_000)], ids=["0", "20", "60"])
def test_all_take_off_fly_and_land(rough: Rough) -> None:
    """Beside each other at once, also where messages are lost, and each back at its place."""
    row, above = places(3, 1), wandering(3, 1)
    # They are back after five seconds: one that landed on its way could cover the place of another.
    swarm = Swarm(row, rough, [Habits(takes_off=0, lands=10_000_000)] * 3, 1)
    swarm.run(16_000_000, lambda since, system: above(since, system) if since < 5e6 else row[system - 1])
    assert not swarm.faults()
    for vehicle in swarm.vehicles:
        assert len(vehicle.columns) == 2
        assert any(made.found for made in vehicle.made)


def test_columns_matter_in_these_flights() -> None:
    """Others come as near to a column as they may."""
    least = [at_random(seed, Rough()).least() for seed in range(8)]
    d = at_random(0, Rough()).d
    assert min(least) < d + 0.1


def test_planes_are_upright_only_once_no_agreement_on_a_plan_in_space_is_kept() -> None:
    """Until then a column must not be flown, or become a plan in space, at another height."""
    two = agreed()
    for number in (1, 2):
        assert not two.first.on_columns()
        for system, x in ((OWN, 0.0), (OTHER, 4.0)):
            two.make(system, plan(number, x)._replace(column=system == OWN))
        assert not two.first.on_columns()
        two.agree(NOW + number * LENGTH)
        if two.first.on_columns():
            break
    assert two.first.on_columns()


def test_who_is_below_a_hovering_vehicle_waits_and_does_not_stop_it() -> None:
    """It says for whom it waits, as long as the other has not moved away."""
    swarm = below(2_000_000)
    assert not swarm.vehicles[0].columns
    assert swarm.vehicles[0].flight.reservation.missing(0).startswith("room for its column: the plan of 2")
    assert any(made.found for made in swarm.vehicles[1].made)
    assert not swarm.faults()


def test_of_two_whose_columns_are_too_near_none_climbs_and_both_say_so() -> None:
    near = np.array([[0.0, 0.0, 5.0], [1.3, 0.0, 5.0]])
    swarm = Swarm(near, Rough(), [Habits(takes_off=0)] * 2, 0)
    swarm.run(4_000_000, lambda since, system: near[system - 1])
    for vehicle in swarm.vehicles:
        assert not vehicle.columns
        assert vehicle.flight.reservation.missing(0).startswith("room for its column")


def test_who_hears_nothing_of_an_expected_vehicle_does_not_climb() -> None:
    silent = Rough(cuts=((0, NEVER, frozenset({3})),))
    swarm = fly([Habits(takes_off=0), Habits(), Habits()], silent, 1)
    vehicle = swarm.vehicles[0]
    assert not vehicle.columns
    assert vehicle.flight.reservation.missing(0) == "the agreement of 3 on its column"
    assert not swarm.faults()


def test_a_silent_vehicle_that_cannot_meet_the_column_does_not_keep_it_from_becoming_a_plan_in_space() -> (
    None
):
    """It begins anew while the other climbs, is heard once more, and then never again."""
    begins = 900_000
    habits = [Habits(takes_off=0), Habits(), Habits(restarts=begins, frozen=((begins + 100_000, NEVER),))]
    swarm = fly(habits, Rough(), 1, 4_000_000)
    ((climbs, left),) = swarm.vehicles[0].columns
    assert climbs < begins < climbs + CLIMB
    assert swarm.vehicles[0].flight.agreements.missing() == {3}
    assert left < climbs + CLIMB + 3 * LENGTH
    assert not swarm.faults()


@FLIGHTS
@given(st.integers(0, 2**16), losses, delays)
def test_plans_are_apart_if_another_begins_anew_during_the_climb(seed: int, loss: float, delay: int) -> None:
    """It rests when its companion restarts; afterwards both wander, and it may be silent for ever."""
    rng = np.random.default_rng(seed)
    begins = int(rng.integers(300_000, 2_000_000))
    silent = ((begins + int(rng.integers(20_000, 400_000)), NEVER),) if rng.random() < 0.5 else ()
    row, wander = places(2, seed), wandering(2, seed)
    swarm = Swarm(
        row, Rough(loss, delay, 0.2), [Habits(takes_off=0), Habits(restarts=begins, frozen=silent)], seed
    )
    swarm.run(UNTIL, lambda since, system: row[system - 1] if since < begins else wander(since, system))
    assert not swarm.faults()


@pytest.mark.parametrize(("x", "clear"), [(1.2, False), (4.0, True), (None, False)])
def test_who_can_meet_a_column_is_near_or_unknown(x: float | None, clear: bool) -> None:
    """The plan of the other is a column, too: 1.5 m are needed."""
    one = agreements(OWN, OWN, OTHER)
    one.made(plan()._replace(column=True))
    if x is not None:
        one.receive_plan(NOW, OTHER, pack(plan(x=x)._replace(column=True)))
    assert one.missing() == {OTHER}
    assert one.clear({OTHER}) is clear


@pytest.mark.parametrize(("reserved", "x"), [(False, 9.0), (True, 9.0), (True, 1.0)])
def test_a_column_waits_for_all_agreements_if_it_was_never_reserved_or_another_may_meet_it(
    reserved: bool, x: float
) -> None:
    """Another controller took the vehicle off, so that planes may be kept that are not upright; or the plan
    of one that begins anew, at ``x`` (m), is too near."""
    flight = CertifiedFlight(CONFIG, Source(OWN, COMPONENT), FLEET)
    stands = Motion(np.zeros(3), np.zeros(3), np.zeros(3))
    for now in range(EPOCH, EPOCH + 4 * LENGTH, LENGTH):
        if reserved:
            flight.park(now, stands, joins=True)
        else:
            flight.reservation.begin(now, stands.position, joins=True)
    begun = resting(now, DT, STEPS, (x, 0.0, 0.0), FLEET.fingerprint)
    flight.agreements.receive_plan(now, OTHER, pack(begun))
    assert flight.agreements.missing() == {OTHER}
    assert flight.reservation.may_be_left() is (reserved and x > 2.0)


def test_a_column_that_is_begun_elsewhere_has_not_been_reserved() -> None:
    """It was moved on the ground: what the others keep is the column before."""
    flight = CertifiedFlight(CONFIG, Source(OWN, COMPONENT), FLEET)
    for number, x in enumerate((0.0, 0.0, 0.0, 0.0, 3.0)):
        stands = Motion(np.array([x, 0.0, 0.0]), np.zeros(3), np.zeros(3))
        flight.park(EPOCH + number * LENGTH, stands, joins=True)
        assert flight.reservation.was_reserved is (number in (2, 3))


def test_no_reservation_survives_a_landing() -> None:
    """Its agreements ended with the farewell, though the column is the same; the next is waited for anew."""
    flight = CertifiedFlight(CONFIG, Source(OWN, COMPONENT), FLEET)
    stands, reserved = Motion(np.zeros(3), np.zeros(3), np.zeros(3)), []
    for number, joins in enumerate((True, True, True, True, False, False, True, True, True, True)):
        now = EPOCH + number * LENGTH
        flight.park(now, stands, joins=joins)
        flight.messages(now, farewell=not joins)
        reserved.append(flight.reservation.was_reserved)
    assert reserved == [False, False, True, True, False, False, False, False, True, True]


def test_who_does_not_take_off_is_passed_and_is_not_waited_for() -> None:
    swarm = fly([Habits(takes_off=NEVER), Habits(), Habits()], Rough(0.2, 100_000), 3)
    assert not swarm.faults()
    assert {made.system for made in swarm.made() if made.found} == {2, 3}


@pytest.mark.parametrize("noise", [0.06, 0.2])
def test_who_waits_for_room_keeps_its_column_in_spite_of_noise_and_says_as_many_farewells(
    noise: float,
) -> None:
    """A column that is begun anew is announced an epoch later: its farewells would come late, or never."""
    still, noisy = farewells(below(2_000_000)), farewells(below(2_000_000, noise))
    assert len(still) > 20
    assert [said.epoch for said in noisy] == [said.epoch for said in still]


def test_who_waited_for_room_joins_where_it_stands() -> None:
    """Its column is where it reports to be when it joins, not where it was parked."""
    swarm = below(3_000_000, 0.2)
    one = swarm.vehicles[0]
    stands = Motion(np.array([-3.0, 0.1, 0.0]), np.zeros(3), np.zeros(3))
    one.flight.park(EPOCH + 3_000_000, stands, joins=True)
    column = one.flight.commitment.announced()
    assert one.flight.reservation.joined
    assert column is not None
    np.testing.assert_allclose(column.position_m, stands.position, atol=1e-3)


def test_who_has_landed_does_not_give_way_to_a_column() -> None:
    """Of two columns that are too near, the one of the higher id moves aside; but not once it has landed."""
    two = agreed()
    two.make(OWN, plan(1)._replace(column=True))
    two.first.receive_plan(NOW + LENGTH, OTHER, pack(plan(1, 1.2)._replace(column=True)))
    assert two.first.columns == {OTHER}
    assert two.first.near() == {OTHER}
    two.first.receive_statement(NOW + LENGTH, OTHER, leaving(1))
    assert two.first.left.keys() == {OTHER}
    assert two.first.columns == set()


def test_the_wait_for_a_reservation_asks_once_who_has_agreed(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    often: list[int] = []
    unreserved, missing = Agreements.unreserved, Reservation.missing

    def counted(reservation: Reservation, now: int) -> str:
        asked.clear()
        found = missing(reservation, now)
        often.append(len(asked))
        return found

    monkeypatch.setattr(Agreements, "unreserved", lambda self: asked.append(1) or unreserved(self))
    monkeypatch.setattr(Reservation, "missing", counted)
    fly([Habits(takes_off=0), Habits()], Rough(), 1, 1_500_000)
    assert often
    assert max(often) == 1


@pytest.mark.parametrize("column", [False, True])
def test_how_far_a_vehicle_is_from_its_plan_is_judged_by_the_plan_of_the_epoch(column: bool) -> None:
    """Also at the epoch's first step, before ``due`` turns to its plan: a column counts horizontally."""
    here = np.array([0.0, 0.0, 5.0])
    flight = CertifiedFlight(CONFIG, Source(OWN, COMPONENT), FLEET)
    flight.stand(EPOCH, here)
    now = EPOCH
    while flight.commitment.following is None or not flight.commitment.following.column:
        now += LENGTH
        flight.lower(now)
    if not column:
        now += LENGTH
        flight.commitment.turn(now)
        flight.commitment.leave_column()
    flight.watch(now + LENGTH - 1, Motion(here + UP, np.zeros(3), np.zeros(3)))
    assert flight.deviation == pytest.approx(1.0 if column else 0.0, abs=1e-3)
    flight.watch(now + LENGTH, Motion(here + UP, np.zeros(3), np.zeros(3)))
    assert flight.deviation == pytest.approx(0.0 if column else 1.0, abs=1e-3)


class Above:
    """1 hovers, and 2 above it or beside it at ``place`` (3,), m; what they send arrives unless ``lost``."""

    def __init__(self, place: Array) -> None:
        config = CONFIG
        self.places = {OWN: np.array([0.0, 0.0, 5.0]), OTHER: place}
        self.flights = {s: CertifiedFlight(config, Source(s, COMPONENT), FLEET) for s in self.places}
        self.now, self.lost = EPOCH, False
        for system, flight in self.flights.items():
            flight.stand(self.now, self.places[system])

    def step(self, handle: Callable[[CertifiedFlight, int], bool]) -> None:
        """1 is handled by ``handle``, which returns whether it says farewell; 2 hovers."""
        self.now += 20_000
        one, two = self.flights.values()
        sent = one.messages(self.now, farewell=handle(one, self.now))
        hover(two, self.now)
        for receiver, messages in ((two, sent), (one, two.messages(self.now))):
            for message in messages:
                if isinstance(message, Tunnel) and not self.lost:
                    receiver.receive(self.now, message)

    def run(self, handle: Callable[[CertifiedFlight, int], bool], steps: int = 100) -> None:
        for _ in range(steps):
            self.step(handle)

    def missing(self) -> set[int]:
        return set().union(*(flight.agreements.missing() for flight in self.flights.values()))


def hover(flight: CertifiedFlight, now: int) -> bool:
    if flight.due(now):
        flight.commitment.carry_on(HoldReason.MISSING)
    return False


def lowers(flight: CertifiedFlight, now: int) -> bool:
    assert flight.lower(now)
    return False


def sinks(flight: CertifiedFlight, now: int) -> bool:
    flight.descend(now)
    return True


def given_back(flight: CertifiedFlight, now: int) -> bool:
    """It has sunk by a metre."""
    if flight.commitment.column:
        flight.leave_column(now, Motion(np.array([0.0, 0.0, 4.0]), np.zeros(3), np.zeros(3)), flies=True)
        return False
    return hover(flight, now)


@pytest.mark.parametrize("pilot", [False, True], ids=["at once", "after a pilot"])
@pytest.mark.parametrize("heard", [False, True], ids=["farewell lost", "farewell heard"])
def test_after_a_stopped_landing_without_a_reservation_all_agree_again(pilot: bool, heard: bool) -> None:
    """3 m above each other no column can be agreed on, and none may be left without an agreement."""
    pair = Above(np.array([0.3, 0.0, 8.0]))
    one = pair.flights[OWN]
    one.reservation.joined = True
    pair.run(hover)
    assert not pair.missing()
    pair.lost = not heard
    pair.run(sinks, 30)
    if pilot:
        pair.run(lambda flight, now: False, 30)
    pair.lost = False
    one.stand(pair.now, np.array([0.1, 0.0, 4.0]))
    assert not one.commitment.column
    pair.run(given_back)
    assert not pair.missing()


@pytest.mark.parametrize("pilot", [False, True], ids=["at once", "after a pilot"])
def test_after_a_stopped_landing_a_reserved_column_goes_on(pilot: bool) -> None:
    """The others keep it, whether they have heard of the farewell or not; it is left when all agree."""
    pair = Above(np.array([9.0, 0.0, 8.0]))
    one = pair.flights[OWN]
    one.reservation.joined = True
    pair.run(hover)
    pair.run(lowers)
    assert not one.reservation.missing(pair.now)
    pair.run(sinks, 30)
    if pilot:
        pair.run(lambda flight, now: False, 30)
    one.stand(pair.now, np.array([0.1, 0.0, 4.0]))
    assert one.commitment.column
    assert one.commitment.anchored_anew == 0
    pair.run(given_back)
    assert not pair.missing()
    assert not one.commitment.column


def test_a_column_that_waits_for_its_reservation_goes_on_while_its_agreements_last() -> None:
    """The mode changes for a moment: nothing is void, and the others may have agreed on the column."""
    pair = Above(np.array([9.0, 0.0, 8.0]))
    pair.run(hover)
    pair.lost = True
    pair.run(lowers)
    one = pair.flights[OWN]
    assert one.reservation.missing(pair.now)
    one.stand(pair.now, pair.places[OWN])
    assert one.commitment.column


def farewells(swarm: Swarm) -> list[Statement]:
    found = []
    for payload in swarm.sent:
        with suppress(PlanWireError):
            found.append(unpack(payload))
    return [said for said in found if said.farewell]


def below(until: int, noise: float = 0.0) -> Swarm:
    """1 is to take off below 2, which hovers; its estimate on the ground has ``noise`` (m)."""
    habits = [Habits(takes_off=0, wanders=noise), Habits()]
    swarm = Swarm(np.array([[0.0, 0.0, 5.0], [0.3, 0.0, 5.0]]), Rough(), habits, 0)
    swarm.run(until, lambda since, system: np.array([0.3, 0.0, 5.0]))
    return swarm


def flights() -> Iterator[Swarm]:
    """Of one below another, and twenty at random."""
    yield below(3_000_000)
    for seed in range(20):
        yield at_random(seed, Rough(0.9, 500_000) if seed % 2 else Rough(0.3, 150_000, 0.2))


def climb_without_waiting(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Vehicle, "may_move", lambda self, now: self.flight.commitment.column)


def ignore_the_column(patch: pytest.MonkeyPatch) -> None:
    """Planes near a column are in space."""

    def in_space(self: Distances, own: Array, other: Array, columns: int) -> Array:
        upright, downwash = self._planar, self._downwash
        return agreed_planes(own, other, self.least(columns), upright=upright, downwash=downwash)

    patch.setattr(Distances, "agreed", in_space)


def agree_nearer_than_allowed(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Agreements, "near", lambda self, plans=None, column=None: set())
    patch.setattr(Negotiation, "_reservable", lambda self, newest, plans: True)


def keep_planes_in_space(patch: pytest.MonkeyPatch) -> None:
    """The landing begins though an agreement on a plan in space is kept."""
    patch.setattr(Agreements, "_on_column", lambda self, one: True)


def look_at_heights(patch: pytest.MonkeyPatch) -> None:
    """A plan is taken for apart from a column if it is high enough above it."""
    apart = Distances.apart
    patch.setattr(Distances, "apart", lambda self, one, other, columns: apart(self, one, other, 0))


@pytest.mark.parametrize(
    "mutation",
    [
        climb_without_waiting,
        ignore_the_column,
        agree_nearer_than_allowed,
        keep_planes_in_space,
        look_at_heights,
    ],
)
def test_a_missing_rule_is_found(mutation: Callable[[Any], None], monkeypatch: pytest.MonkeyPatch) -> None:
    mutation(monkeypatch)
    assert any(swarm.faults() for swarm in flights())
