"""What is known of the others: one plan of each for each epoch, whoever counts is never forgotten, and a
farewell is believed only with the plan that it leaves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.committed import carried_on, committed, controls, resting
from companion.avoidance.certified.peer_plans import PeerPlans
from companion.values.horizon import Array
from mavlink_bridge.wire.plan import WirePlan, pack
from mavlink_bridge.wire.roster import Roster
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS

OWN, OTHER, THIRD = 1, 2, 3
ORIGIN = 7
LENGTH = 200_000
NOW = EPOCH + 30_000


def peers(expected: frozenset[int] = frozenset()) -> PeerPlans:
    return PeerPlans(OWN, expected, STEPS, DT, LENGTH, ORIGIN)


def plan(epoch: int = 0, x: float = 0.0, speed: float = 0.0) -> WirePlan:
    """From (x, 0, 5) m on, in epoch number ``epoch``, braking from ``speed`` (m/s)."""
    start = resting(EPOCH + epoch * LENGTH, DT, STEPS, (x, 0.0, 5.0), ORIGIN)
    start = start._replace(velocity=(round(speed / (1e-9 * DT)), 0, 0))
    slowing: Array = -start.velocity_m_s / (1e-6 * DT * STEPS) + 0.0 * start.accelerations_m_s2
    return committed(start, slowing)


def receive(
    book: PeerPlans, system: int, what: WirePlan, *members: int, now: int = NOW, bye: bool = False
) -> None:
    book.receive_plan(now, system, pack(what))
    book.receive_roster(now, system, Roster(what.epoch, frozenset(members), bye))


@given(st.integers(0, 8 * 128 - 1), st.lists(st.booleans(), min_size=1, max_size=6))
def test_a_plan_altered_in_one_bit_is_never_held_beside_the_true_one(bit: int, order: list[bool]) -> None:
    """It is refused, or it is the only one of its epoch that is ever held: whichever comes first."""
    true = pack(plan(speed=1.0))
    altered = bytearray(true)
    altered[bit // 8] ^= 1 << bit % 8
    book, first = peers(), None
    for intact in order:
        book.receive_plan(NOW, OTHER, true if intact else bytes(altered))
        held = [filed.plan for filed in book.plans(EPOCH).values()]
        first = held[0] if first is None and held else first
        assert held == ([] if first is None else [first])
        assert len(held) <= 1
    if first is not None:
        different = sum(intact != (pack(first) == true) for intact in order)
        assert book.refused == different
        np.testing.assert_array_equal(book.plans(EPOCH)[OTHER].controls, controls(first))
    else:
        assert not any(order)
        assert book.refused == len(order)


@given(st.binary(max_size=140))
def test_any_other_bytes_are_refused(data: bytes) -> None:
    book = peers()
    book.receive_plan(NOW, OTHER, data)
    assert book.refused == 1
    assert not book.members


@pytest.mark.parametrize(
    "bad",
    [
        plan()._replace(origin=8),
        plan()._replace(dt=100_000),
        plan()._replace(epoch=EPOCH + 4),
        plan(epoch=5),
        plan(epoch=-5),
        plan()._replace(velocity=(1, 0, 0)),
        plan()._replace(accelerations=plan().accelerations[:-1]),
    ],
    ids=["frame", "step", "between epochs", "far ahead", "long ago", "does not rest", "short"],
)
def test_what_cannot_be_a_committed_plan_is_refused(bad: WirePlan) -> None:
    book = peers()
    book.receive_plan(NOW, OTHER, pack(bad))
    assert book.refused == 1
    assert not book.members


def test_who_is_expected_is_missing_until_its_plan_of_the_epoch_is_here_and_it_counts_with_us() -> None:
    book = peers(frozenset({OWN, OTHER}))
    assert book.missing(EPOCH) == {OTHER}
    book.receive_plan(NOW, OTHER, pack(plan()))
    assert book.missing(EPOCH) == {OTHER}
    book.receive_roster(NOW, OTHER, Roster(EPOCH, frozenset({OWN})))
    assert not book.missing(EPOCH)
    assert book.missing(EPOCH + LENGTH) == {OTHER}
    book.receive_roster(NOW, OTHER, Roster(EPOCH + LENGTH, frozenset({THIRD})))
    assert book.missing(EPOCH) == {OTHER, THIRD}


def test_whoever_one_counts_with_counts_and_is_never_forgotten() -> None:
    book = peers()
    receive(book, OTHER, plan(), OWN, THIRD)
    assert book.members == {OTHER, THIRD}
    assert book.missing(EPOCH) == {THIRD}
    receive(book, THIRD, plan(x=3.0), OWN, OTHER)
    assert not book.missing(EPOCH)
    for epoch in range(1, 12):
        now = NOW + epoch * LENGTH
        receive(book, OTHER, plan(epoch), OWN, now=now)
        assert book.members == {OTHER, THIRD}
        assert book.missing(EPOCH + epoch * LENGTH) == {THIRD}


def test_who_is_heard_by_its_roster_alone_counts() -> None:
    """Its plan is lost, but it flies one."""
    book = peers()
    book.receive_roster(NOW, OTHER, Roster(EPOCH, frozenset({OWN})))
    assert book.members == {OTHER}
    assert book.missing(EPOCH) == {OTHER}
    book.receive_plan(NOW, OTHER, pack(plan()))
    assert not book.missing(EPOCH)


def test_a_roster_by_a_clock_that_is_far_ahead_is_refused_and_stands_in_no_ones_way() -> None:
    book = peers()
    book.receive_roster(NOW, OTHER, Roster(EPOCH + 25 * LENGTH, frozenset({OWN})))
    assert book.refused == 1
    receive(book, OTHER, plan(), OWN)
    assert book.members == {OTHER}
    assert not book.missing(EPOCH)


def test_of_two_rosters_the_later_epoch_counts_whichever_comes_last() -> None:
    book = peers()
    receive(book, OTHER, plan(1), OWN)
    book.receive_roster(NOW, OTHER, Roster(EPOCH, frozenset()))
    assert not book.missing(EPOCH + LENGTH)


@given(st.permutations(range(4)))
def test_who_counts_with_us_does_so_from_the_epoch_on_that_it_first_said_so_with(order: list[int]) -> None:
    """Its plan of that epoch may be made without us, those that follow are not; later words change nothing,
    nor does their order."""
    book = peers(frozenset({OTHER}))
    for epoch in range(4):
        book.receive_plan(NOW, OTHER, pack(plan(epoch)))
    for epoch in order:
        members = frozenset({OWN}) if epoch >= 2 else frozenset[int]()
        book.receive_roster(NOW, OTHER, Roster(EPOCH + epoch * LENGTH, members))
        assert book.missing(EPOCH) == book.missing(EPOCH + LENGTH) == {OTHER}
    assert not book.missing(EPOCH + 3 * LENGTH)


def test_its_own_words_are_not_news() -> None:
    book = peers()
    receive(book, OWN, plan(), OTHER)
    assert not book.members
    assert not book.plans(EPOCH)


class TestFarewell:
    def test_who_left_is_neither_a_member_nor_missing(self) -> None:
        book = peers(frozenset({OTHER}))
        receive(book, OTHER, plan(), OWN)
        receive(book, OTHER, plan(), OWN, bye=True)
        assert not book.members
        assert not book.missing(EPOCH + 3 * LENGTH)
        assert book.left[OTHER].plan == plan()

    def test_its_last_plan_is_flown_to_the_end(self) -> None:
        book, last = peers(), plan(speed=2.0)
        receive(book, OTHER, last, OWN)
        receive(book, OTHER, last, OWN, bye=True)
        for epoch in (0, 1, 7, 40):
            assert book.plans(EPOCH + epoch * LENGTH)[OTHER].plan == carried_on(last, epoch)

    def test_it_is_not_believed_without_the_plan_that_it_goes_with(self) -> None:
        """An older one may end elsewhere."""
        book = peers()
        receive(book, OTHER, plan(), OWN)
        later = NOW + LENGTH
        book.receive_roster(later, OTHER, Roster(EPOCH + LENGTH, frozenset({OWN}), farewell=True))
        assert book.missing(EPOCH + LENGTH) == {OTHER}
        assert not book.left
        receive(book, OTHER, plan(1, x=0.5), OWN, now=later, bye=True)
        assert not book.missing(EPOCH + LENGTH)
        assert book.left[OTHER].plan == plan(1, x=0.5)

    def test_it_is_not_believed_before_its_epoch(self) -> None:
        """Until then another plan is flown."""
        book = peers()
        receive(book, OTHER, plan(1), OWN, bye=True)
        assert book.missing(EPOCH) == {OTHER}
        receive(book, OTHER, plan(1), OWN, bye=True, now=NOW + LENGTH)
        assert not book.missing(EPOCH + LENGTH)

    def test_it_is_not_believed_when_it_comes_late(self) -> None:
        """Its sender may have joined again, and everything it said since may be lost."""
        for late, believed in ((4 * LENGTH, True), (4 * LENGTH + 1, False), (60_000_000, False)):
            book = peers(frozenset({OTHER}))
            receive(book, OTHER, plan(), OWN)
            book.receive_roster(EPOCH + late, OTHER, Roster(EPOCH, frozenset({OWN}), farewell=True))
            assert bool(book.left) == believed
            assert bool(book.members) != believed

    def test_what_was_said_before_it_and_comes_after_it_changes_nothing(self) -> None:
        book = peers()
        receive(book, OTHER, plan(), OWN)
        receive(book, OTHER, plan(2), OWN, bye=True, now=NOW + 2 * LENGTH)
        receive(book, OTHER, plan(1), OWN, now=NOW + 2 * LENGTH)
        receive(book, OTHER, plan(2), OWN, now=NOW + 2 * LENGTH)
        assert not book.members
        assert book.left[OTHER].plan == plan(2)

    def test_who_comes_back_counts_again(self) -> None:
        book = peers()
        receive(book, OTHER, plan(), OWN, bye=True)
        receive(book, OTHER, plan(3, x=1.0), now=NOW + 3 * LENGTH)
        assert book.missing(EPOCH + 3 * LENGTH) == {OTHER}
        receive(book, OTHER, plan(4, x=1.0), OWN, now=NOW + 4 * LENGTH)
        assert not book.missing(EPOCH + 4 * LENGTH)

    @pytest.mark.parametrize("announced", range(-1, 9))
    def test_after_the_own_one_only_those_count_with_us_who_cannot_believe_it_any_more(
        self, announced: int
    ) -> None:
        """A roster is told from two epochs before its own on; a farewell is believed for four."""
        book = peers(frozenset({OTHER}))
        receive(book, OTHER, plan(-1), OWN)
        book.leave(EPOCH)
        now = EPOCH + announced * LENGTH
        receive(book, OTHER, plan(announced), OWN, now=now)
        believed = peers()
        receive(believed, OTHER, plan(), now=EPOCH)
        believed.receive_roster(now - 2 * LENGTH, OTHER, Roster(EPOCH, frozenset(), farewell=True))
        assert bool(book.missing(now)) == (announced <= 6)
        assert bool(book.missing(now)) >= bool(believed.left)

    def test_who_said_it_counts_with_us_only_when_it_says_so_again(self) -> None:
        """It may have begun anew since, and know nothing of us."""
        book = peers()
        receive(book, OTHER, plan(), OWN)
        receive(book, OTHER, plan(), OWN, bye=True)
        receive(book, OTHER, plan(3, x=1.0), now=NOW + 3 * LENGTH)
        receive(book, OTHER, plan(4, x=1.0), now=NOW + 4 * LENGTH)
        assert book.missing(EPOCH + 4 * LENGTH) == {OTHER}
