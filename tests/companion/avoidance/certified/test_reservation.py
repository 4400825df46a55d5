"""The reservation of a column: for whom it waits, what ends it, and where the column is."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest

from companion.avoidance.certified.column_agreements import ColumnAgreements
from companion.avoidance.certified.committed import resting
from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.certified.reservation import Reservation
from companion.values.components import COMPONENT
from companion.values.horizon import Motion
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.messages import Source
from mavlink_bridge.wire.agreements import Statement, unpack
from mavlink_bridge.wire.plan import pack
from tests.companion.avoidance.certified.column_flights import CONFIG, below, fly
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS
from tests.companion.avoidance.certified.rough import FLEET, Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm
from tests.companion.avoidance.certified.two import LENGTH, NOW, OTHER, OWN, agreed, agreements, leaving, plan

UP = np.array([0.0, 0.0, 1.0])
"""m."""


def test_planes_are_upright_only_once_no_agreement_on_a_plan_in_space_is_kept() -> None:
    """Until then a column must not be flown, or become a plan in space, at another height."""
    two = agreed()
    columns = ColumnAgreements(two.first)
    for number in (1, 2):
        assert not columns.on_columns()
        for system, x in ((OWN, 0.0), (OTHER, 4.0)):
            two.make(system, plan(number, x)._replace(column=system == OWN))
        assert not columns.on_columns()
        two.agree(NOW + number * LENGTH)
        if columns.on_columns():
            break
    assert columns.on_columns()


@pytest.mark.parametrize(("x", "clear"), [(1.2, False), (4.0, True), (None, False)])
def test_who_can_meet_a_column_is_near_or_unknown(x: float | None, clear: bool) -> None:
    """The plan of the other is a column, too: 1.5 m are needed."""
    one = agreements(OWN, OWN, OTHER)
    one.made(plan()._replace(column=True))
    if x is not None:
        one.receive_plan(NOW, OTHER, pack(plan(x=x)._replace(column=True)))
    assert one.missing() == {OTHER}
    assert ColumnAgreements(one).clear({OTHER}) is clear


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


def test_who_has_landed_does_not_give_way_to_a_column() -> None:
    """Of two columns that are too near, the one of the higher id moves aside; but not once it has landed."""
    two = agreed()
    two.make(OWN, plan(1)._replace(column=True))
    two.first.receive_plan(NOW + LENGTH, OTHER, pack(plan(1, 1.2)._replace(column=True)))
    assert two.first.peers.columns == {OTHER}
    assert ColumnAgreements(two.first).near() == {OTHER}
    two.first.receive_statement(NOW + LENGTH, OTHER, leaving(1))
    assert two.first.peers.left.keys() == {OTHER}
    assert two.first.peers.columns == set()


def test_the_wait_for_a_reservation_asks_once_who_has_agreed(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    often: list[int] = []
    unreserved, missing = ColumnAgreements.unreserved, Reservation.missing

    def counted(reservation: Reservation, now: int) -> str:
        asked.clear()
        found = missing(reservation, now)
        often.append(len(asked))
        return found

    monkeypatch.setattr(ColumnAgreements, "unreserved", lambda self: asked.append(1) or unreserved(self))
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
    assert flight.tube.deviation == pytest.approx(1.0 if column else 0.0, abs=1e-3)
    flight.watch(now + LENGTH, Motion(here + UP, np.zeros(3), np.zeros(3)))
    assert flight.tube.deviation == pytest.approx(0.0 if column else 1.0, abs=1e-3)


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


def farewells(swarm: Swarm) -> list[Statement]:
    found = []
    for payload in swarm.sent:
        with suppress(PlanWireError):
            found.append(unpack(payload))
    return [said for said in found if said.farewell]
