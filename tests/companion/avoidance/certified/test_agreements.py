"""Agreements with all peers: proposed, taken, refused and stated."""

from __future__ import annotations

import pytest

from companion.avoidance.certified.committed import carried_on, controls
from companion.avoidance.certified.pair import Agreement
from mavlink_bridge.wire.agreements import Entry
from mavlink_bridge.wire.plan import pack
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.two import (
    LENGTH,
    NOW,
    OTHER,
    OWN,
    agreed,
    epoch,
    plan,
    statement,
)


def test_two_agree_within_a_round_of_messages() -> None:
    two = agreed()
    assert two.first.kept() == {OTHER: (Agreement(EPOCH, EPOCH),)}
    assert two.second.kept() == {OWN: (Agreement(EPOCH, EPOCH),)}
    assert not two.first.missing()
    assert not two.second.missing()
    (plans,) = two.first.agreed()
    assert (plans.own.plan, plans.other.plan) == (plan(), plan(x=4.0))


def test_they_agree_anew_on_the_plans_of_each_epoch_and_drop_the_old_ones() -> None:
    two = agreed()
    for number in range(1, 60):
        two.make(OWN, plan(number, x=0.01 * number))
        two.make(OTHER, plan(number, x=4.0 + 0.01 * number))
        two.agree(NOW + number * LENGTH)
        newest = (Agreement(epoch(number), epoch(number)),)
        assert two.first.kept()[OTHER] == two.second.kept()[OWN] == newest
        assert not two.first.missing() | two.second.missing()


def test_of_plans_that_are_only_carried_on_nothing_new_is_proposed() -> None:
    two = agreed()
    for number in range(1, 4):
        two.make(OWN, carried_on(plan(), number))
        two.make(OTHER, carried_on(plan(x=4.0), number))
        two.agree(NOW + number * LENGTH)
        assert two.first.kept() == {OTHER: (Agreement(EPOCH, EPOCH),)}
        assert not two.first.outdated(NOW, epoch(number))


def test_a_plan_of_an_agreement_stays_available_however_long_the_peer_is_silent() -> None:
    """It was agreed on the plans of the first epoch; 199 plans of both follow, and no agreement on them."""
    two = agreed()
    for number in range(1, 200):
        two.first.made(plan(number, x=-0.1 * number))
        now = NOW + number * LENGTH
        two.first.receive_plan(now, OTHER, pack(plan(number, x=4.0 + 0.1 * number)))
        two.first.update(now)
        assert Agreement(EPOCH, EPOCH) in two.first.kept()[OTHER]
        plans = two.first.agreed()
        assert len(plans) == len(two.first.kept()[OTHER]) <= 5
        assert (plans[0].own.plan, plans[0].other.plan) == (plan(), plan(x=4.0))
    assert not two.first.missing()
    # What the peer has not answered is sent again.
    assert two.first.unanswered()


def test_an_agreement_is_taken_only_if_the_newest_plan_keeps_its_planes() -> None:
    """The own plan leads across the middle of the two plans that the peer proposes."""
    two = agreed()
    crossing = plan(1, x=0.0, speed=2.4)
    across = 0.5 * (controls(plan(1))[-1, 2, 0] + 4.0)
    assert controls(crossing)[-1, 2, 0] > across
    two.make(OWN, crossing)
    proposed = Agreement(EPOCH, epoch(1))
    peer = Entry(OWN, ((EPOCH, EPOCH), (epoch(1), EPOCH)), (epoch(1), EPOCH))
    two.first.receive_plan(NOW + LENGTH, OTHER, pack(plan(1, x=4.0)))
    two.first.receive_statement(NOW + LENGTH, OTHER, statement(1, peer))
    two.first.update(NOW + LENGTH)
    assert proposed not in two.first.kept()[OTHER]
    assert two.first.kept()[OTHER][0] == Agreement(EPOCH, EPOCH)
    (entry,) = two.first.entries(every=True)
    assert entry.considered >= (EPOCH, epoch(1))


def test_a_plan_that_breaks_the_confirmed_agreement_is_not_proposed() -> None:
    """It came late: the peer made it before it took that agreement, and nothing kept it away since."""
    two = agreed()
    two.make(OWN, plan(2))
    two.first.receive_plan(NOW + 2 * LENGTH, OTHER, pack(plan(1, x=0.6)))
    two.first.update(NOW + 2 * LENGTH)
    assert two.first.kept() == {OTHER: (Agreement(EPOCH, EPOCH),)}
    two.first.receive_plan(NOW + 2 * LENGTH, OTHER, pack(plan(2, x=2.6)))
    two.first.update(NOW + 2 * LENGTH)
    assert two.first.kept() == {OTHER: (Agreement(EPOCH, EPOCH), Agreement(epoch(2), epoch(2)))}


def test_an_agreement_on_a_plan_that_has_not_arrived_waits_for_it() -> None:
    two = agreed()
    two.make(OWN, plan(1))
    peer = Entry(OWN, ((EPOCH, EPOCH), (epoch(1), EPOCH)), (epoch(1), EPOCH))
    two.first.receive_statement(NOW + LENGTH, OTHER, statement(1, peer))
    two.first.update(NOW + LENGTH)
    before = two.first.kept()[OTHER]
    two.first.receive_plan(NOW + LENGTH, OTHER, pack(plan(1, x=4.0)))
    two.first.update(NOW + LENGTH)
    assert len(two.first.kept()[OTHER]) > len(before) or two.first.kept()[OTHER][-1].other == epoch(1)


def test_after_a_new_beginning_nothing_is_agreed_until_both_have_agreed_anew() -> None:
    two = agreed()
    two.first.begin(epoch(1))
    assert two.first.missing() == {OTHER}
    assert two.first.kept() == {OTHER: ()}
    two.make(OWN, plan(1, x=-1.0))
    two.make(OTHER, plan(1, x=4.0))
    two.tell(OWN, NOW + LENGTH)
    # The other has heard of the beginning: it keeps nothing of before.
    assert all(one.other >= epoch(1) for one in two.second.kept()[OWN])
    two.agree(NOW + LENGTH)
    assert not two.first.missing() | two.second.missing()


@pytest.mark.parametrize("silent", [0, 900_000, 1_100_000])
def test_a_plan_waits_for_agreements_on_newer_plans_but_not_with_who_is_silent(silent: int) -> None:
    two = agreed()
    assert not two.first.outdated(NOW, EPOCH)
    two.first.made(plan(1, x=0.1))
    assert two.first.outdated(NOW + silent, epoch(1)) == (silent <= 1_000_000)


def test_an_offer_on_a_plan_that_can_no_longer_arrive_is_refused() -> None:
    """Its sender is free for another one; before 2 s the plan may still come."""
    for number in (9, 12):
        two = agreed()
        two.make(OWN, plan(number))
        offered = (epoch(1), EPOCH)
        peer = Entry(OWN, ((EPOCH, EPOCH), offered), offered)
        now = NOW + number * LENGTH
        two.first.receive_statement(now, OTHER, statement(number, peer))
        two.first.update(now)
        (entry,) = two.first.entries(every=True)
        assert (entry.considered == (EPOCH, epoch(1))) == (number == 12)


def test_changes_are_stated_once() -> None:
    two = agreed()
    two.first.entries(every=True)
    assert not two.first.changed
    assert two.first.entries(every=False) == ()
    two.make(OWN, plan(1, x=0.1))
    two.first.update(NOW)
    assert not two.first.changed
    two.first.receive_plan(NOW + LENGTH, OTHER, pack(plan(1, x=4.0)))
    two.first.update(NOW + LENGTH)
    assert two.first.changed
    (entry,) = two.first.entries(every=False)
    assert entry.agreements[-1] == (epoch(1), epoch(1))
    assert not two.first.changed
