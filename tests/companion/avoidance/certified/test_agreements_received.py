"""Plans and statements count once, and only if they fit."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.values.refused_senders import RefusedSenders
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.plan import WirePlan, pack, unpack
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.two import (
    FRAME,
    LENGTH,
    NOW,
    OTHER,
    OWN,
    THIRD,
    agreed,
    agreements,
    doubled,
    epoch,
    plan,
    statement,
)

FOREIGN, DIFFERING = RefusedSenders(foreign=(OTHER,)), RefusedSenders(differing=(OTHER,))
EARLY = RefusedSenders(wrong_clock=(OTHER,))


@given(st.integers(0, 8 * 128 - 1), st.lists(st.booleans(), min_size=1, max_size=6))
def test_of_a_plan_and_one_altered_in_one_bit_only_the_first_counts(bit: int, order: list[bool]) -> None:
    """Unless the altered one is no plan at all."""
    true = pack(plan(speed=1.0))
    altered = bytearray(true)
    altered[bit // 8] ^= 1 << bit % 8
    alone, one = agreements(), agreements()
    alone.receive_plan(NOW, OTHER, bytes(altered))
    for intact in order:
        one.receive_plan(NOW, OTHER, true if intact else bytes(altered))
    if alone.refused:
        assert (one.refused, doubled(one)) == (order.count(False), ())
    elif unpack(bytes(altered)).epoch == EPOCH:
        others = sum(intact != order[0] for intact in order)
        assert one.refused == others
        assert doubled(one) == ((OTHER,) if others else ())


@given(st.binary(max_size=140))
def test_any_other_bytes_are_refused(data: bytes) -> None:
    one = agreements()
    one.receive_plan(NOW, OTHER, data)
    assert one.refused == 1
    assert not one.peers.members


@pytest.mark.parametrize(
    ("bad", "reported"),
    [
        (plan()._replace(origin=8), FOREIGN),
        (plan()._replace(dt=100_000), DIFFERING),
        (plan()._replace(epoch=EPOCH + 4), DIFFERING),
        (plan(5), EARLY),
        (plan(-13), RefusedSenders()),
        (plan()._replace(velocity=(1, 0, 0)), RefusedSenders()),
        (plan()._replace(accelerations=plan().accelerations[:-1]), DIFFERING),
    ],
    ids=["frame", "step", "between epochs", "far ahead", "long ago", "does not rest", "short"],
)
def test_what_cannot_be_a_committed_plan_is_refused(bad: WirePlan, reported: RefusedSenders) -> None:
    one = agreements()
    one.receive_plan(NOW, OTHER, pack(bad))
    assert one.refused == 1
    assert one.refused_senders(NOW) == reported
    assert one.refused_senders(NOW + 5_000_000) == RefusedSenders()
    assert not one.peers.members


def test_nothing_is_agreed_with_two_vehicles_of_one_id() -> None:
    """The lists are empty, and the others hear so; after 5 s without contradiction it begins anew."""
    two = agreed()
    two.first.receive_plan(NOW, OTHER, pack(plan(x=3.0)))
    assert two.first.missing() == {OTHER}
    two.agree(NOW)
    assert two.first.missing() == {OTHER}
    assert two.second.missing() == {OWN}
    for system, x in ((OWN, 0.0), (OTHER, 4.0)):
        two.make(system, plan(25, x))
    two.agree(NOW + 25 * LENGTH)
    assert not two.first.missing() | two.second.missing()


def test_two_plans_of_an_epoch_show_two_vehicles_with_an_id() -> None:
    one = agreements()
    one.receive_plan(NOW, OTHER, pack(plan()))
    for _ in range(2):
        one.receive_plan(NOW, OTHER, pack(plan()))
    assert (one.refused, doubled(one)) == (0, ())
    one.receive_plan(NOW, OTHER, pack(plan(x=1.0)))
    assert (one.refused, doubled(one)) == (1, (OTHER,))
    assert one.refused_senders(NOW + 5_000_000) == RefusedSenders()


def test_a_statement_of_another_fleet_is_refused_though_eight_bits_of_it_agree() -> None:
    one = agreements()
    other = Statement(FRAME ^ 0x100, EPOCH, EPOCH, (Entry(OWN), Entry(THIRD)))
    one.receive_statement(NOW, OTHER, other)
    assert one.refused == 1
    assert one.refused_senders(NOW).differing == (OTHER,)
    assert not one.peers.members


def test_of_a_vehicle_of_another_fleet_no_plan_is_accepted_whichever_message_comes_first() -> None:
    one = agreements()
    other = Statement(FRAME ^ 0x100, EPOCH, EPOCH, (Entry(OWN),))
    one.receive_plan(NOW, OTHER, pack(plan()))
    assert one.peers.members == {OTHER}
    one.receive_statement(NOW, OTHER, other)
    assert not one.peers.members
    one.receive_plan(NOW, OTHER, pack(plan()))
    assert not one.peers.members
    assert one.refused == 2
    # Its sender begins again, with the settings of this fleet.
    later = NOW + 5_000_000
    one.receive_plan(later, OTHER, pack(plan(25)))
    one.receive_statement(later, OTHER, statement(25, Entry(OWN), since=25))
    assert one.peers.members == {OTHER}
    assert one.refused_senders(later) == RefusedSenders()


def test_without_a_statement_nothing_is_proposed() -> None:
    """The sender of the plan may be of another fleet."""
    one = agreements()
    one.begin(EPOCH)
    one.made(plan())
    one.receive_plan(NOW, OTHER, pack(plan(x=4.0)))
    one.update(NOW)
    assert not one.kept()[OTHER]
    one.receive_statement(NOW, OTHER, statement(0, Entry(OWN)))
    one.update(NOW)
    assert one.kept()[OTHER]


def test_an_id_that_sends_statements_of_two_fleets_stops_the_planning_beside_it() -> None:
    two = agreed()
    two.first.receive_statement(NOW, OTHER, Statement(FRAME ^ 1, EPOCH, EPOCH, (Entry(OWN),)))
    assert two.first.missing() == {OTHER}
    assert two.first.refused_senders(NOW) == RefusedSenders(differing=(OTHER,))
    two.agree(NOW)
    assert two.first.missing() == {OTHER}
    for system, x in ((OWN, 0.0), (OTHER, 4.0)):
        two.make(system, plan(25, x))
    two.agree(NOW + 25 * LENGTH)
    assert not two.first.missing() | two.second.missing()


def test_a_statement_by_a_clock_that_is_far_ahead_is_refused_and_stands_in_no_ones_way() -> None:
    one = agreements()
    one.receive_statement(NOW, OTHER, statement(25, Entry(OWN), since=25))
    assert one.refused == 1
    assert not one.peers.members
    one.receive_statement(NOW, OTHER, statement(0, Entry(OWN)))
    assert one.peers.members == {OTHER}


@pytest.mark.parametrize(("number", "since"), [(25, 0), (0, 25)])
def test_a_statement_of_a_time_to_come_is_refused_and_its_sender_named(number: int, since: int) -> None:
    """A beginning in the future would make all agreements void until then."""
    two = agreed()
    two.first.receive_statement(NOW, OTHER, statement(number, Entry(OWN), since=since))
    assert not two.first.missing()
    assert two.first.refused == 1
    assert two.first.refused_senders(NOW) == RefusedSenders(wrong_clock=(OTHER,))
    assert two.first.refused_senders(NOW + 5_000_000) == RefusedSenders()


@pytest.mark.parametrize(("x", "taken"), [(0.9, False), (1.1, True)])
@pytest.mark.parametrize("proposes", [OWN, OTHER])
def test_after_a_contradiction_only_plans_that_are_apart_are_agreed_on(
    proposes: int, x: float, taken: bool
) -> None:
    """Nothing that the sender agreed to before says where its plans are: the least distance is 1 m."""
    two = agreed()
    two.first.receive_plan(NOW, OTHER, pack(plan(x=3.0)))
    now = NOW + 25 * LENGTH
    two.make(OWN, plan(25))
    two.make(OTHER, plan(25, x))
    two.second.begin(epoch(25))
    two.make(OTHER, plan(25, x))
    for system in (proposes, OWN + OTHER - proposes):
        two.tell(system, now)
    assert bool(two.first.kept()[OTHER]) == taken
    two.agree(now)
    assert (two.first.missing() == set()) == taken
