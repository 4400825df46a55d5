"""Laws of two lists of agreements: while both vehicles may plan, there is an agreement that both keep."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from companion.avoidance.certified.pair import NONE, Agreement, Pair
from mavlink_bridge.wire.agreements import MOST_AGREEMENTS, Entry

STEP = 4
"""µs from epoch to epoch."""
epochs = st.integers(1, 9)
sides = st.integers(0, 1)
agreements = st.builds(Agreement, epochs, epochs)


class Side:
    """One vehicle: its plans are numbered, and it states its list with the epoch of its newest plan."""

    def __init__(self, own: int, peer: int) -> None:
        self.pair = Pair(own, peer)
        self.epoch = self.since = STEP
        self.heard = 0
        """Latest beginning of the other that it has heard of."""
        self.taken: set[Agreement] = set()

    def state(self) -> tuple[int, int, Entry]:
        return self.epoch, self.since, self.pair.entry(departed=False)

    def hear(self, epoch: int, since: int, entry: Entry) -> None:
        before = self.pair.kept
        changed = self.pair.receive(epoch, since, entry)
        assert changed == (self.pair.kept != before)
        assert not changed or since >= self.heard
        self.heard = max(self.heard, since)

    def take(self, one: Agreement) -> None:
        """Take ``one``, which never happens twice."""
        assert one not in self.taken
        assert one.own >= self.since
        self.taken.add(one)
        self.pair.take(one)


def turned(one: Agreement) -> Agreement:
    """The same agreement as the other vehicle sees it."""
    return Agreement(one.other, one.own)


class TwoVehicles(RuleBasedStateMachine):
    """Two that make plans, propose and take agreements and begin anew, on a channel that keeps all messages
    and delivers any of them at any time, or never, or again."""

    def __init__(self) -> None:
        super().__init__()
        self.sides = Side(1, 2), Side(2, 1)
        self.sent: tuple[list[tuple[int, int, Entry]], ...] = ([], [])

    @rule(which=sides)
    def make_a_plan(self, which: int) -> None:
        """A new one or the old one, carried on; the clocks are alike."""
        side, other = self.sides[which], self.sides[1 - which]
        if side.epoch <= other.epoch + STEP:
            side.epoch += STEP

    @rule(which=sides, back=st.integers(0, 3))
    def propose(self, which: int, back: int) -> None:
        """An agreement of the newest own plan and one of the latest of the other that begin no later."""
        side, other = self.sides[which], self.sides[1 - which]
        one = Agreement(side.epoch, min(side.epoch, other.epoch) - back * STEP)
        if one.other > 0 and side.pair.may_take(one):
            side.take(one)

    @rule(which=sides, satisfied=st.booleans())
    def consider(self, which: int, satisfied: bool) -> None:
        """The newest offer is taken if the newest own plan satisfies it."""
        side = self.sides[which]
        for one in side.pair.offers:
            if one.epoch <= side.epoch and side.pair.may_take(one) and one.own >= side.since:
                if satisfied:
                    side.take(one)
                else:
                    side.pair.refuse(one)
                break

    @rule(which=sides)
    def say(self, which: int) -> None:
        self.sent[which].append(self.sides[which].state())

    @rule(which=sides, back=st.integers(0, 9))
    def hear(self, which: int, back: int) -> None:
        """One of the latest statements of the other."""
        said = self.sent[1 - which]
        if said:
            self.sides[which].hear(*said[-1 - back % len(said)])

    @rule(which=sides)
    def begin_anew(self, which: int) -> None:
        side = self.sides[which]
        side.epoch += STEP
        side.since = side.epoch
        side.pair.void()

    @rule(seed=st.integers(0, 2**32 - 1))
    def go_on_at_random(self, seed: int) -> None:
        """Many of the steps above: what goes wrong seldom needs long stories."""
        rng = np.random.default_rng(seed)
        chosen = rng.choice(6, 150, p=[0.15, 0.15, 0.2, 0.2, 0.29, 0.01]).tolist()
        for action, which, drawn in zip(
            chosen, rng.integers(0, 2, 150).tolist(), rng.random(150), strict=True
        ):
            if action == 0:
                self.make_a_plan(which)
            elif action == 1:
                self.propose(which, int(2 * drawn**2))
            elif action == 2:
                self.consider(which, bool(drawn < 0.7))
            elif action == 3:
                self.say(which)
            elif action == 4:
                self.hear(which, int(20 * drawn**4))
            else:
                self.begin_anew(which)
            self.both_keep_one_while_both_may_plan()
            self.lists_are_in_order_and_hold_only_what_was_taken()

    @invariant()
    def both_keep_one_while_both_may_plan(self) -> None:
        one, two = (side.pair for side in self.sides)
        if one.confirmed is not None and two.confirmed is not None:
            assert set(one.kept) & set(map(turned, two.kept))

    @invariant()
    def lists_are_in_order_and_hold_only_what_was_taken(self) -> None:
        for side, other in (self.sides, self.sides[::-1]):
            pair = side.pair
            assert all(pair.newer(after, before) for before, after in pairwise(pair.kept))
            assert set(pair.kept) <= side.taken
            assert len(pair.kept) <= MOST_AGREEMENTS
            assert not any(pair.newer(one, pair.considered) for one in pair.kept)
            assert all(one.own >= side.since and one.other >= side.heard for one in pair.kept)
            assert set(pair.open) <= set(pair.kept)
            if pair.confirmed is not None:
                assert pair.confirmed == pair.kept[0]
                assert turned(pair.confirmed) in other.taken


TestTwoVehicles = TwoVehicles.TestCase
TestTwoVehicles.settings = settings(max_examples=60, stateful_step_count=20, deadline=None)


@given(st.lists(agreements, min_size=2, max_size=8, unique=True))
def test_both_vehicles_have_the_same_order(some: list[Agreement]) -> None:
    one, two = Pair(1, 2), Pair(2, 1)
    for a in some:
        for b in some:
            assert one.newer(a, b) == two.newer(turned(a), turned(b))
            assert one.newer(a, b) + one.newer(b, a) == (a != b)
            assert one.newer(a, NONE)


def test_an_agreement_is_dropped_once_the_other_has_stated_a_newer_one() -> None:
    old, new = Agreement(4, 4), Agreement(8, 8)
    one, two = Pair(1, 2), Pair(2, 1)
    for pair in (one, two):
        pair.take(old)
        pair.take(new)
        assert pair.kept == (old, new)
    assert one.receive(8, 4, two.entry(departed=False))
    assert [*one.kept] == [one.confirmed] == [new]
    assert not one.receive(8, 4, two.entry(departed=False))
    assert two.kept == (old, new)


def test_an_agreement_is_dropped_once_the_other_has_refused_it() -> None:
    """It is not if the other's statement was made before it could consider the agreement."""
    old, new = Agreement(4, 4), Agreement(8, 8)
    one, two = Pair(1, 2), Pair(2, 1)
    for pair in (one, two):
        pair.take(old)
    one.take(new)
    one.receive(4, 4, two.entry(departed=False))
    assert one.kept == (old, new)
    two.refuse(turned(new))
    one.receive(4, 4, two.entry(departed=False))
    assert one.kept == (old, new)
    one.receive(8, 4, two.entry(departed=False))
    assert one.kept == (old,)
    assert one.considered == new
    assert not one.may_take(new)
    assert not two.may_take(turned(new))


def test_what_is_refused_is_never_taken_and_neither_is_anything_older() -> None:
    pair = Pair(1, 2)
    pair.refuse(Agreement(8, 8))
    pair.refuse(Agreement(4, 4))
    assert pair.considered == Agreement(8, 8)
    assert not pair.may_take(Agreement(8, 8))
    assert not pair.may_take(Agreement(4, 8))
    assert pair.may_take(Agreement(12, 8))


def test_a_new_beginning_of_the_other_voids_what_was_agreed_on_plans_before() -> None:
    old = Agreement(4, 4)
    one, two = Pair(1, 2), Pair(2, 1)
    for pair in (one, two):
        pair.take(old)
    before = two.entry(departed=False)
    one.receive(4, 4, before)
    assert one.confirmed == old
    two.void()
    assert one.receive(8, 8, two.entry(departed=False))
    assert not one.kept
    assert one.confirmed is None
    assert not one.may_take(Agreement(12, 4))
    # What it stated before, and comes late, changes nothing.
    one.take(Agreement(8, 8))
    assert not one.receive(4, 4, before)
    assert one.kept == (Agreement(8, 8),)
    assert one.confirmed is None


def test_the_own_new_beginning_voids_all() -> None:
    pair = Pair(1, 2)
    pair.take(Agreement(4, 4))
    pair.receive(4, 4, Entry(1, ((4, 4), (8, 4)), (8, 4)))
    assert pair.offers
    pair.void()
    assert not pair.kept
    assert not pair.offers
    assert pair.considered == Agreement(4, 4)
    assert not set(pair.referenced())


def test_offers_are_the_newest_first_and_gone_when_a_later_statement_lacks_them() -> None:
    pair = Pair(1, 2)
    offered = Entry(1, ((8, 4), (8, 8), (12, 8)), (12, 8))
    pair.receive(12, 4, offered)
    assert pair.offers == [Agreement(8, 12), Agreement(8, 8), Agreement(4, 8)]
    assert set(pair.referenced()) == set(pair.offers)
    pair.receive(12, 4, offered._replace(agreements=((12, 8),)))
    assert pair.offers == [Agreement(8, 12)]
    # An older statement that comes late takes nothing back.
    pair.receive(8, 4, offered)
    assert Agreement(8, 12) in pair.offers


def test_no_more_is_taken_than_one_message_holds() -> None:
    pair = Pair(1, 2)
    for number in range(1, MOST_AGREEMENTS + 1):
        one = Agreement(number * STEP, STEP)
        assert pair.may_take(one)
        pair.take(one)
    assert not pair.may_take(Agreement(99 * STEP, STEP))
    assert pair.open == pair.kept


def test_of_a_new_pair_nothing_is_kept() -> None:
    pair = Pair(1, 2)
    assert pair.kept == pair.open == ()
    assert pair.confirmed is None
    assert pair.entry(departed=True) == Entry(2, departed=True)
