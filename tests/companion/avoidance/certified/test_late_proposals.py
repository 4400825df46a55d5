"""Agreements on plans of one epoch that arrive when newer ones have been made."""

from __future__ import annotations

from heapq import heappush

import numpy as np
import pytest

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.pair import Agreement
from companion.values.horizon import Array
from mavlink_bridge.messages import Tunnel
from mavlink_bridge.wire.agreements import Entry
from mavlink_bridge.wire.plan import pack
from tests.companion.avoidance.certified.plans import EPOCH as BEGIN
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import TICK, Swarm
from tests.companion.avoidance.certified.two import (
    LENGTH,
    NOW,
    OTHER,
    OWN,
    Two,
    agreed,
    epoch,
    plan,
    statement,
)
from tests.companion.avoidance.certified.vehicle import Vehicle

FIRST = Agreement(epoch(0), epoch(0))
"""Two that are at 0 and 4 m have agreed on it: the own plans stay below 1.5 m, half of d from the middle."""


def hears(one: Agreements, sender: int, number: int, x: float, at: int) -> None:
    """``one`` receives the plan of epoch ``number``, which rests at ``x`` (m), in epoch ``at``."""
    now = NOW + at * LENGTH
    one.receive_plan(now, sender, pack(plan(number, x=x)))
    one.update(now)


def late(places: tuple[float, ...], other: float = 4.0) -> Two:
    """The plans of the first rest at ``places`` (m), from epoch 1 on; then the other's of 1 arrives."""
    two = agreed()
    for number, x in enumerate(places, 1):
        two.make(OWN, plan(number, x=x))
    hears(two.first, OTHER, 1, other, len(places))
    return two


def test_both_propose_the_plans_of_one_epoch_and_each_proposal_answers_the_other() -> None:
    two = late((0.1, 0.2, 0.3))
    for number in (1, 2, 3):
        two.make(OTHER, plan(number, x=4.0))
    hears(two.second, OWN, 1, 0.1, 3)
    proposed = Agreement(epoch(1), epoch(1))
    assert two.first.kept() == {OTHER: (FIRST, proposed)}
    assert two.second.kept() == {OWN: (FIRST, proposed)}
    entries = two.first.entries(every=True), two.second.entries(every=True)
    two.second.receive_statement(NOW + 3 * LENGTH, OWN, statement(3, *entries[0]))
    two.first.receive_statement(NOW + 3 * LENGTH, OTHER, statement(3, *entries[1]))
    assert two.first.kept() == {OTHER: (proposed,)}
    assert two.second.kept() == {OWN: (proposed,)}


@pytest.mark.parametrize(
    ("places", "other"),
    [
        pytest.param((1.9, 0.5), 4.0, id="the own plan of that epoch breaks the confirmed agreement"),
        pytest.param((0.1, 0.5), 2.1, id="the other's does"),
        pytest.param((-2.0, 1.4), 4.0, id="the own newest plan breaks the new agreement"),
        pytest.param((-2.0, 1.4, 0.0), 4.0, id="the one that is flown until then does"),
    ],
)
def test_an_agreement_is_not_proposed_where(places: tuple[float, ...], other: float) -> None:
    two = late(places, other)
    assert two.first.kept() == {OTHER: (FIRST,)}
    # The next one is.
    number = len(places) + 1
    two.make(OWN, plan(number, x=0.4))
    hears(two.first, OTHER, number, 4.0, number)
    assert two.first.kept() == {OTHER: (FIRST, Agreement(epoch(number), epoch(number)))}


def test_a_confirmed_agreement_on_a_later_plan_is_not_followed() -> None:
    """Its planes begin with that plan, and say nothing of the time before. A peer of other rules made it."""
    two = agreed()
    for number in (1, 2, 3):
        two.make(OTHER, plan(number, x=4.0 + 0.1 * number))
    hears(two.second, OWN, 1, 0.0, 3)
    mixed = (epoch(1), epoch(3))
    entry = Entry(OTHER, (FIRST, mixed), mixed)
    two.second.receive_statement(NOW + 3 * LENGTH, OWN, statement(3, entry))
    two.second.update(NOW + 3 * LENGTH)
    assert two.second.kept() == {OWN: (Agreement(epoch(3), epoch(1)),)}
    hears(two.second, OWN, 2, 0.0, 3)
    assert two.second.kept() == {OWN: (Agreement(epoch(3), epoch(1)),)}
    hears(two.second, OWN, 3, 0.1, 3)
    assert two.second.kept() == {
        OWN: (Agreement(epoch(3), epoch(1)), Agreement(epoch(3), epoch(3))),
    }


def test_nothing_is_proposed_on_plans_of_before_the_own_return() -> None:
    two = agreed()
    two.make(OWN, plan(1))
    two.first.leave(epoch(1))
    hears(two.first, OTHER, 1, 4.0, 1)
    assert two.first.rejoin()
    two.make(OWN, plan(2))
    two.first.update(NOW + 2 * LENGTH)
    assert two.first.kept() == {OTHER: ()}
    hears(two.first, OTHER, 2, 4.0, 2)
    assert two.first.kept() == {OTHER: (Agreement(epoch(2), epoch(2)),)}


def test_two_that_never_make_plans_of_one_epoch_agree_on_their_newest() -> None:
    """Each misses every second epoch, as on a machine that is busy."""
    two = agreed()
    for number in range(1, 40):
        system = OWN if number % 2 else OTHER
        two.make(system, plan(number, x=0.01 * number + (0.0 if system == OWN else 4.0)))
        two.tell(system, NOW + number * LENGTH)
    for one, other in ((two.first, OTHER), (two.second, OWN)):
        (oldest, *_) = one.kept()[other]
        assert min(oldest) > epoch(20)


class Late(Swarm):
    """Each message arrives exactly ``late`` µs after it was sent."""

    late = 300_000

    def _carry(self, since: int, sender: Vehicle, message: Tunnel) -> None:
        for receiver in self.vehicles:
            if receiver is not sender:
                heappush(receiver.inbox, (since + self.late, next(self._serial), message))


class Aged(Late):
    """Notes how old (µs) the oldest plan of each vehicle's agreements is."""

    def __init__(self, starts: Array) -> None:
        super().__init__(starts, Rough(), [Habits()] * len(starts), 1)
        self.ages: dict[int, int] = {}

    def record(self, since: int, one: Vehicle) -> None:
        super().record(since, one)
        kept = [epoch for two in one.flight.agreements.kept().values() for each in two for epoch in each]
        if since >= 3_000_000 and kept:
            age = BEGIN + since - min(kept)
            self.ages[one.system] = max(self.ages.get(one.system, 0), age)


def test_agreements_of_both_are_two_delays_old() -> None:
    swarm = Aged(np.array([[0.0, 0.0, 5.0], [6.0, 0.0, 5.0]]))

    def moves(since: int, system: int) -> Array:
        return np.array([6.0 * (system - 1), 3.0 * np.sin(1e-6 * since), 5.0])

    swarm.run(8_000_000, moves)
    assert not swarm.faults()
    lead = swarm.config.certified.lead_us
    # A step for the plan and for each of the two messages, and an epoch until the next agreement.
    most = 2 * swarm.late + 3 * TICK + LENGTH - lead
    assert set(swarm.ages) == {1, 2}
    assert max(swarm.ages.values()) <= most
