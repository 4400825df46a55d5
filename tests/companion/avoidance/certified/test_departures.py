"""A farewell is accepted only with the plan that it leaves, and only if it answers an own plan of now."""

from __future__ import annotations

import pytest

from companion.avoidance.certified.committed import carried_on
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.plan import pack
from tests.companion.avoidance.certified.plans import DT, EPOCH
from tests.companion.avoidance.certified.two import (
    FRAME,
    LENGTH,
    NOW,
    OTHER,
    OWN,
    THIRD,
    Two,
    agreed,
    agreements,
    epoch,
    leaving,
    plan,
    statement,
)


def test_who_left_with_its_newest_plan_is_no_member() -> None:
    one = agreements(OWN, OWN, OTHER)
    one.receive_plan(NOW, OTHER, pack(plan(speed=2.0)))
    one.receive_statement(NOW, OTHER, leaving())
    assert not one.peers.members | one.missing()
    assert one.peers.left[OTHER].plan == plan(speed=2.0)
    assert one.entries(every=True) == (Entry(OTHER, departed=True),)


def test_its_agreements_are_void() -> None:
    two = agreed()
    two.first.receive_statement(NOW, OTHER, leaving())
    assert two.first.peers.left.keys() == {OTHER}
    assert not two.first.agreed()
    assert not two.first.kept()
    assert not two.first.outdated(NOW, EPOCH)


def test_a_farewell_without_its_plan_is_not_accepted() -> None:
    one = agreements(OWN, OWN, OTHER)
    one.receive_plan(NOW, OTHER, pack(plan()))
    one.receive_statement(NOW + LENGTH, OTHER, leaving(1))
    assert not one.peers.left
    assert one.missing() == {OTHER}
    one.receive_plan(NOW + LENGTH, OTHER, pack(plan(1, x=0.5)))
    assert not one.peers.left
    one.receive_statement(NOW + LENGTH, OTHER, leaving(1))
    assert one.peers.left[OTHER].plan == plan(1, x=0.5)


def test_a_farewell_that_comes_after_a_later_plan_is_not_accepted() -> None:
    """However late it comes: its sender may have begun anew."""
    one = agreements(OWN, OWN, OTHER)
    for number in (0, 1):
        one.receive_plan(NOW, OTHER, pack(plan(number)))
    for late in (0, 60_000_000):
        one.receive_statement(NOW + late, OTHER, leaving())
        assert not one.peers.left
        assert one.peers.members == {OTHER}


def test_what_was_stated_before_a_farewell_and_comes_late_changes_nothing() -> None:
    one = agreements(OWN, OWN, OTHER)
    one.receive_plan(NOW + LENGTH, OTHER, pack(plan(1)))
    one.receive_statement(NOW + LENGTH, OTHER, leaving(1))
    one.receive_plan(NOW + LENGTH, OTHER, pack(plan()))
    for number in (0, 1):
        one.receive_statement(
            NOW + LENGTH, OTHER, statement(number, Entry(OWN, ((EPOCH, EPOCH),), (EPOCH, EPOCH)))
        )
    assert one.peers.left[OTHER].plan == plan(1)
    assert not one.peers.members


def test_a_farewell_counts_only_once_its_plan_has_begun() -> None:
    """By a clock that is ahead it comes earlier; constraints are made from plans that have begun."""
    one = agreements(OWN, OWN, OTHER)
    one.receive_plan(NOW, OTHER, pack(plan(2)))
    one.receive_statement(NOW, OTHER, leaving(2))
    assert one.peers.members == {OTHER}
    one.receive_statement(epoch(2), OTHER, leaving(2))
    assert one.peers.left[OTHER].plan == plan(2)


def test_a_later_plan_ends_a_departure_unless_it_is_the_last_plan_carried_on() -> None:
    """The statement with it may be lost."""
    one = agreements(OWN, OWN, OTHER)
    last = plan(0, x=4.0, speed=1.0)
    one.receive_plan(NOW, OTHER, pack(last))
    one.receive_statement(NOW, OTHER, leaving(0))
    one.receive_plan(epoch(1), OTHER, pack(carried_on(last, LENGTH // DT)))
    assert not one.peers.members
    one.receive_plan(epoch(2), OTHER, pack(plan(2, x=3.0)))
    assert one.peers.members == one.missing() == {OTHER}
    assert not one.peers.left


def test_who_comes_back_is_a_member_again_and_needs_an_agreement() -> None:
    two = agreed()
    two.first.receive_statement(NOW, OTHER, leaving())
    back = NOW + 3 * LENGTH
    two.second.leave(EPOCH)
    two.second.rejoin()
    two.make(OWN, plan(3))
    two.make(OTHER, plan(3, x=4.0))
    statement_without_agreements = Statement(FRAME, epoch(3), two.second.since, (Entry(OWN),))
    two.first.receive_statement(back, OTHER, statement_without_agreements)
    assert two.first.peers.members == two.first.missing() == {OTHER}
    assert not two.first.peers.left
    two.agree(back)
    assert not two.first.missing() | two.second.missing()
    assert all(one.other > EPOCH for one in two.first.kept()[OTHER])


def test_after_the_own_farewell_nothing_is_agreed_on_plans_up_to_it() -> None:
    two = agreed()
    two.first.leave(epoch(2))
    assert two.first.since == EPOCH
    two.first.rejoin()
    assert two.first.since == epoch(3)
    assert two.first.missing() == {OTHER}
    assert not two.first.agreed()
    (entry,) = two.first.entries(every=False)
    assert entry.agreements == ()


def test_after_the_own_farewell_nothing_is_taken_that_was_stated_before_it() -> None:
    """The peer had agreed on the last plan; its statement comes late, before and after the return."""
    two = agreed()
    two.make(OWN, plan(1))
    late = Entry(OWN, ((EPOCH, EPOCH), (EPOCH, epoch(1))), (EPOCH, epoch(1)))
    two.first.leave(epoch(1))
    for number in (1, 2, 3):
        if number == 2:
            two.first.rejoin()
        two.first.receive_statement(NOW + number * LENGTH, OTHER, statement(1, late))
        two.first.update(NOW + number * LENGTH)
        assert all(one.own >= epoch(2) for one in two.first.kept()[OTHER])
        assert two.first.missing() == {OTHER}
        two.make(OWN, carried_on(plan(1), number))


@pytest.mark.parametrize("answers", [False, True])
def test_a_farewell_counts_only_if_its_sender_has_considered_a_plan_since_the_own_beginning(
    answers: bool,
) -> None:
    one = agreements(OWN, OWN, OTHER)
    one.begin(epoch(3))
    one.receive_plan(epoch(4), OTHER, pack(plan(4)))
    considered = epoch(4), epoch(3) if answers else epoch(2)
    farewell = statement(4, Entry(THIRD, considered=(epoch(4), epoch(9))), Entry(OWN, (), considered))
    one.receive_statement(epoch(4), OTHER, farewell._replace(farewell=True))
    assert (OTHER in one.peers.left) == answers


def test_who_ends_before_there_is_an_agreement_is_not_waited_for() -> None:
    """Its backup node says farewell with the last entries that it stated."""
    two = Two()
    two.make(OWN, plan())
    two.make(OTHER, plan(1, x=4.0))
    # The second does not lead, and nothing was proposed to it, because the first has received nothing of it.
    two.tell(OWN, NOW)
    entries = tuple(entry._replace(agreements=()) for entry in two.second.entries(every=True))
    now = NOW + LENGTH
    two.first.receive_plan(now, OTHER, pack(plan(1, x=4.0)))
    two.first.receive_statement(now, OTHER, Statement(FRAME, epoch(1), EPOCH, entries, farewell=True))
    assert two.first.peers.left.keys() == {OTHER}
    # What was received bars no agreement.
    alive = Two()
    alive.make(OWN, plan())
    alive.make(OTHER, plan(1, x=4.0))
    alive.tell(OWN, NOW)
    alive.make(OWN, plan(1))
    for system in (OTHER, OWN, OTHER, OWN):
        alive.tell(system, now)
    assert not alive.first.missing() | alive.second.missing()


def test_a_farewell_answers_the_newest_plan_that_was_received() -> None:
    two = agreed()
    two.first.receive_plan(epoch(3), OTHER, pack(plan(3, x=4.0)))
    two.first.leave(epoch(4))
    (entry,) = two.first.entries(every=True)
    assert (entry.agreements, entry.considered) == ((), (epoch(4), epoch(3)))


def test_between_the_own_farewell_and_the_return_no_farewell_counts() -> None:
    """Its sender may return meanwhile. The others are told that it had left, as far as is known."""
    one = agreements(OWN, OWN, OTHER)
    one.receive_plan(NOW, OTHER, pack(plan()))
    one.receive_statement(NOW, OTHER, leaving())
    assert one.peers.left.keys() == {OTHER}
    one.leave(epoch(1))
    for _ in range(2):
        assert not one.peers.left
        assert one.missing() == {OTHER}
        assert one.entries(every=True)[0].departed
        one.receive_statement(NOW + LENGTH, OTHER, leaving())
    one.rejoin()
    assert one.since == epoch(2)
    one.receive_statement(epoch(2), OTHER, leaving())
    assert one.missing() == {OTHER}
    # It has received the first plan of the return, and is still away.
    one.receive_statement(
        epoch(2), OTHER, statement(0, Entry(OWN, considered=(EPOCH, epoch(2))), farewell=True)
    )
    assert not one.missing()


def test_a_farewell_of_a_later_departure_ends_the_earlier_one() -> None:
    """It counts by itself, with its plan and its answer; the earlier plan is not flown any more."""
    one = agreements(OWN, OWN, OTHER)
    one.receive_plan(NOW, OTHER, pack(plan()))
    one.receive_statement(NOW, OTHER, leaving())
    one.receive_statement(epoch(3), OTHER, leaving(2))
    assert one.peers.left.keys() == {OTHER}
    one.receive_statement(epoch(3), OTHER, leaving(3)._replace(since=epoch(2)))
    assert one.missing() == {OTHER}


def test_who_another_controller_flies_is_not_waited_for() -> None:
    two = agreed()
    two.first.made(plan(1, x=0.1))
    assert two.first.outdated(NOW, epoch(1))
    two.first.receive_statement(NOW, OTHER, Statement(FRAME, EPOCH, EPOCH, away=True))
    assert not two.first.outdated(NOW, epoch(1))
