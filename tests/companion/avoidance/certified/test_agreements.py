"""Agreements with all peers: what is received counts once and only if it fits, members are never forgotten,
and a farewell is accepted only with the plan that it leaves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.committed import carried_on, committed, controls, resting
from companion.avoidance.certified.fingerprint import FleetIdentity
from companion.avoidance.certified.pair import Agreement
from companion.avoidance.certified.separating_planes import keeps
from companion.config.certified import CertifiedConfig
from companion.values.horizon import Array
from companion.values.refused_senders import RefusedSenders
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.plan import WirePlan, pack, unpack
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS

OWN, OTHER, THIRD = 1, 2, 3
FRAME = 0xABCDEF07
LENGTH = 200_000
NOW = EPOCH + 30_000
DISTANCE = np.full((1, STEPS + 1), 1.0)


def kept_apart(newest: Array, own: Array, other: Array) -> bool:
    return keeps(newest, own, other, DISTANCE)


def agreements(own: int = OWN, *expected: int) -> Agreements:
    config = CertifiedConfig(epoch_us=LENGTH, dt_us=DT, fleet=expected)
    return Agreements(own, config, STEPS, FleetIdentity(FRAME, FRAME & 0xFF), kept_apart)


def plan(number: int = 0, x: float = 0.0, speed: float = 0.0) -> WirePlan:
    """From (x, 0, 5) m on, from epoch ``number`` on, braking from ``speed`` (m/s)."""
    start = resting(epoch(number), DT, STEPS, (x, 0.0, 5.0), FRAME & 0xFF)
    start = start._replace(velocity=(round(speed / (1e-9 * DT)), 0, 0))
    slowing: Array = -start.velocity_m_s / (1e-6 * DT * STEPS) + 0.0 * start.accelerations_m_s2
    return committed(start, slowing)


def epoch(number: int) -> int:
    return EPOCH + number * LENGTH


def statement(number: int, *entries: Entry, since: int = 0, farewell: bool = False) -> Statement:
    return Statement(FRAME, epoch(number), epoch(since), entries, farewell)


class Two:
    """Two vehicles whose plans and statements arrive at once where a test says so."""

    def __init__(self) -> None:
        self.first, self.second = agreements(OWN, OWN, OTHER), agreements(OTHER, OWN, OTHER)
        for one in (self.first, self.second):
            one.begin(EPOCH)
        self.plans: dict[int, WirePlan] = {}

    def make(self, system: int, made: WirePlan) -> None:
        (self.first if system == OWN else self.second).made(made)
        self.plans[system] = made

    def tell(self, system: int, now: int) -> None:
        """``system`` announces its newest plan and its agreements, and the other hears it."""
        sender, receiver = (self.first, self.second) if system == OWN else (self.second, self.first)
        made = self.plans[system]
        sender.update(now)
        receiver.receive_plan(now, system, pack(made))
        entries = sender.entries(every=True)
        receiver.receive_statement(now, system, Statement(FRAME, made.epoch, sender.since, entries))
        receiver.update(now)

    def agree(self, now: int) -> None:
        for system in (OWN, OTHER, OWN, OTHER):
            self.tell(system, now)


def agreed() -> Two:
    """Two at rest, 4 m apart, that have agreed on their plans of the first epoch."""
    two = Two()
    two.make(OWN, plan())
    two.make(OTHER, plan(x=4.0))
    two.agree(NOW)
    return two


def doubled(one: Agreements) -> tuple[int, ...]:
    return one.refused_senders(NOW).doubled


# Progress


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


# What is received


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
    assert not one.members


@pytest.mark.parametrize(
    ("bad", "refused"),
    [
        (plan()._replace(origin=8), RefusedSenders(foreign=(OTHER,))),
        (plan()._replace(dt=100_000), RefusedSenders(differing=(OTHER,))),
        (plan()._replace(epoch=EPOCH + 4), RefusedSenders(differing=(OTHER,))),
        (plan(5), RefusedSenders()),
        (plan(-13), RefusedSenders()),
        (plan()._replace(velocity=(1, 0, 0)), RefusedSenders()),
        (plan()._replace(accelerations=plan().accelerations[:-1]), RefusedSenders(differing=(OTHER,))),
    ],
    ids=["frame", "step", "between epochs", "far ahead", "long ago", "does not rest", "short"],
)
def test_what_cannot_be_a_committed_plan_is_refused(bad: WirePlan, refused: RefusedSenders) -> None:
    one = agreements()
    one.receive_plan(NOW, OTHER, pack(bad))
    assert one.refused == 1
    assert one.refused_senders(NOW) == refused
    assert one.refused_senders(NOW + 5_000_000) == RefusedSenders()
    assert not one.members


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
    assert not one.members


def test_of_a_vehicle_of_another_fleet_no_plan_is_accepted_whichever_message_comes_first() -> None:
    one = agreements()
    other = Statement(FRAME ^ 0x100, EPOCH, EPOCH, (Entry(OWN),))
    one.receive_plan(NOW, OTHER, pack(plan()))
    assert one.members == {OTHER}
    one.receive_statement(NOW, OTHER, other)
    assert not one.members
    one.receive_plan(NOW, OTHER, pack(plan()))
    assert not one.members
    assert one.refused == 2
    # Its sender begins again, with the settings of this fleet.
    later = NOW + 5_000_000
    one.receive_plan(later, OTHER, pack(plan(25)))
    one.receive_statement(later, OTHER, statement(25, Entry(OWN), since=25))
    assert one.members == {OTHER}
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
    assert not one.members
    one.receive_statement(NOW, OTHER, statement(0, Entry(OWN)))
    assert one.members == {OTHER}


# Members


def test_who_is_expected_is_missing_until_there_is_an_agreement() -> None:
    one = agreements(OWN, OWN, OTHER)
    assert one.missing() == {OTHER}
    one.made(plan())
    one.receive_plan(NOW, OTHER, pack(plan(x=4.0)))
    one.update(NOW)
    assert one.missing() == {OTHER}
    one.receive_statement(NOW, OTHER, statement(0, Entry(OWN, ((EPOCH, EPOCH),), (EPOCH, EPOCH))))
    one.update(NOW)
    assert not one.missing()


@pytest.mark.parametrize("by", ["plan", "statement", "name"])
def test_who_is_heard_or_named_is_a_member_and_never_forgotten(by: str) -> None:
    """It is named to others as soon as a statement shows that it is of this fleet."""
    one = agreements()
    if by == "plan":
        one.receive_plan(NOW, THIRD, pack(plan()))
    elif by == "statement":
        one.receive_statement(NOW, THIRD, statement(0))
    else:
        one.receive_statement(NOW, OTHER, statement(0, Entry(THIRD)))
    for number in range(20):
        assert THIRD in one.members
        assert THIRD in one.missing()
        assert (THIRD in {entry.peer for entry in one.entries(every=True)}) == (by != "plan")
        one.receive_statement(NOW + number * LENGTH, OTHER, statement(number, Entry(OWN)))


def test_who_left_by_the_word_of_another_is_no_member_unless_it_was_heard() -> None:
    one = agreements()
    one.receive_statement(NOW, OTHER, statement(0, Entry(THIRD, departed=True)))
    assert one.members == {OTHER}
    one.receive_statement(NOW, OTHER, statement(1, Entry(THIRD)))
    assert one.members == {OTHER, THIRD}
    # What was stated before and comes late changes nothing.
    one.receive_statement(NOW, OTHER, statement(0, Entry(THIRD, departed=True)))
    assert one.members == {OTHER, THIRD}
    one.receive_plan(NOW, THIRD, pack(plan()))
    one.receive_statement(NOW, OTHER, statement(2, Entry(THIRD, departed=True)))
    assert one.members == {OTHER, THIRD}


def test_nobody_is_a_peer_of_itself() -> None:
    one = agreements(OWN, OWN, OTHER)
    one.receive_statement(NOW, OWN, statement(0, Entry(THIRD)))
    one.receive_statement(NOW, OTHER, statement(0, Entry(OWN)))
    assert one.members == {OTHER}


# Farewells


def leaving(number: int = 0) -> Statement:
    return statement(number, Entry(OWN), farewell=True)


def test_who_left_with_its_newest_plan_is_no_member() -> None:
    one = agreements(OWN, OWN, OTHER)
    one.receive_plan(NOW, OTHER, pack(plan(speed=2.0)))
    one.receive_statement(NOW, OTHER, leaving())
    assert not one.members | one.missing()
    assert one.left[OTHER].plan == plan(speed=2.0)
    assert one.entries(every=True) == (Entry(OTHER, departed=True),)


def test_its_agreements_are_void() -> None:
    two = agreed()
    two.first.receive_statement(NOW, OTHER, leaving())
    assert two.first.left.keys() == {OTHER}
    assert not two.first.agreed()
    assert not two.first.kept()
    assert not two.first.outdated(NOW, EPOCH)


def test_a_farewell_without_its_plan_is_not_accepted() -> None:
    one = agreements(OWN, OWN, OTHER)
    one.receive_plan(NOW, OTHER, pack(plan()))
    one.receive_statement(NOW + LENGTH, OTHER, leaving(1))
    assert not one.left
    assert one.missing() == {OTHER}
    one.receive_plan(NOW + LENGTH, OTHER, pack(plan(1, x=0.5)))
    assert not one.left
    one.receive_statement(NOW + LENGTH, OTHER, leaving(1))
    assert one.left[OTHER].plan == plan(1, x=0.5)


def test_a_farewell_that_comes_after_a_later_plan_is_not_accepted() -> None:
    """However late it comes: its sender may have begun anew."""
    one = agreements(OWN, OWN, OTHER)
    for number in (0, 1):
        one.receive_plan(NOW, OTHER, pack(plan(number)))
    for late in (0, 60_000_000):
        one.receive_statement(NOW + late, OTHER, leaving())
        assert not one.left
        assert one.members == {OTHER}


def test_what_was_stated_before_a_farewell_and_comes_late_changes_nothing() -> None:
    one = agreements(OWN, OWN, OTHER)
    one.receive_plan(NOW + LENGTH, OTHER, pack(plan(1)))
    one.receive_statement(NOW + LENGTH, OTHER, leaving(1))
    one.receive_plan(NOW + LENGTH, OTHER, pack(plan()))
    for number in (0, 1):
        one.receive_statement(
            NOW + LENGTH, OTHER, statement(number, Entry(OWN, ((EPOCH, EPOCH),), (EPOCH, EPOCH)))
        )
    assert one.left[OTHER].plan == plan(1)
    assert not one.members


def test_a_farewell_counts_only_once_its_plan_has_begun() -> None:
    """By a clock that is ahead it comes earlier; constraints are made from plans that have begun."""
    one = agreements(OWN, OWN, OTHER)
    one.receive_plan(NOW, OTHER, pack(plan(2)))
    one.receive_statement(NOW, OTHER, leaving(2))
    assert one.members == {OTHER}
    one.receive_statement(epoch(2), OTHER, leaving(2))
    assert one.left[OTHER].plan == plan(2)


def test_a_later_plan_ends_a_departure_unless_it_is_the_last_plan_carried_on() -> None:
    """The statement with it may be lost."""
    one = agreements(OWN, OWN, OTHER)
    last = plan(0, x=4.0, speed=1.0)
    one.receive_plan(NOW, OTHER, pack(last))
    one.receive_statement(NOW, OTHER, leaving(0))
    one.receive_plan(epoch(1), OTHER, pack(carried_on(last, LENGTH // DT)))
    assert not one.members
    one.receive_plan(epoch(2), OTHER, pack(plan(2, x=3.0)))
    assert one.members == one.missing() == {OTHER}
    assert not one.left


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


def test_who_comes_back_is_a_member_again_and_needs_an_agreement() -> None:
    two = agreed()
    two.first.receive_statement(NOW, OTHER, leaving())
    back = NOW + 3 * LENGTH
    two.second.leave(EPOCH)
    two.make(OWN, plan(3))
    two.make(OTHER, plan(3, x=4.0))
    statement_without_agreements = Statement(FRAME, epoch(3), two.second.since, (Entry(OWN),))
    two.first.receive_statement(back, OTHER, statement_without_agreements)
    assert two.first.members == two.first.missing() == {OTHER}
    assert not two.first.left
    two.agree(back)
    assert not two.first.missing() | two.second.missing()
    assert all(one.other > EPOCH for one in two.first.kept()[OTHER])


def test_after_the_own_farewell_nothing_is_agreed_on_plans_up_to_it() -> None:
    two = agreed()
    two.first.leave(epoch(2))
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
        two.first.receive_statement(NOW + number * LENGTH, OTHER, statement(1, late))
        two.first.update(NOW + number * LENGTH)
        assert all(one.own >= epoch(2) for one in two.first.kept()[OTHER])
        assert two.first.missing() == {OTHER}
        two.make(OWN, carried_on(plan(1), number))


def test_changes_are_stated_once() -> None:
    two = agreed()
    two.first.entries(every=True)
    assert not two.first.changed
    assert two.first.entries(every=False) == ()
    two.make(OWN, plan(1, x=0.1))
    two.first.update(NOW)
    assert two.first.changed
    (entry,) = two.first.entries(every=False)
    assert entry.agreements[-1] == (epoch(1), EPOCH)
    assert not two.first.changed
