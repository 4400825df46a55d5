"""Plans are repeated more often while most transmissions are lost, never otherwise, and with a bound."""

from __future__ import annotations

from collections import Counter
from heapq import heappush

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.committed import horizon_of
from companion.avoidance.certified.peer_plans import PlanFile, stored
from companion.avoidance.certified.repetition import Repetition
from companion.config.certified import CertifiedConfig
from mavlink_bridge.messages import Tunnel
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, pack
from tests.companion.avoidance.certified.plans import EPOCH as BEGIN
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import TICK, Swarm
from tests.companion.avoidance.certified.two import (
    FRAME,
    LENGTH,
    NOW,
    OTHER,
    OWN,
    THIRD,
    agreements,
    epoch,
    plan,
    statement,
)
from tests.companion.avoidance.certified.vehicle import Vehicle

USUAL, SHORT = 50_000, 20_000
CONFIG = CertifiedConfig(dt_us=LENGTH, epoch_us=LENGTH)


def share(loss: float, period: int = USUAL) -> float:
    """The expected received share with independent losses."""
    return float(1.0 - loss ** (LENGTH / period))


def periods(repetition: Repetition, shares: list[float | None], begin: int = 0) -> list[int]:
    """The periods after one share in each epoch."""
    found = []
    for number, one in enumerate(shares):
        repetition.update(begin + number * LENGTH, one)
        found.append(repetition.period)
    return found


@given(st.lists(st.floats(0.0, 0.8).map(share) | st.none(), max_size=60))
def test_below_four_of_five_lost_the_period_is_the_usual_one(shares: list[float | None]) -> None:
    assert set(periods(Repetition(CONFIG), shares)) <= {USUAL}


@given(st.lists(st.floats(0.0, 1.0) | st.none(), max_size=200), st.floats(1.0, 5.0))
def test_the_period_is_the_usual_one_or_shorter_by_the_factor(
    shares: list[float | None], factor: float
) -> None:
    found = periods(Repetition(CONFIG.model_copy(update={"repeat_in_loss": factor})), shares)
    assert set(found) <= {USUAL, round(USUAL / factor)}


@pytest.mark.parametrize(
    ("then", "expected"),
    [
        pytest.param(share(0.9, SHORT), SHORT, id="the loss is as before"),
        pytest.param(share(0.76, SHORT), SHORT, id="it is a little less than where the period changed"),
        pytest.param(share(0.6, SHORT), USUAL, id="it has ended"),
        pytest.param(share(0.1), USUAL, id="it has ended, and the others repeat as usual"),
        pytest.param(None, USUAL, id="nobody is heard"),
    ],
)
def test_the_period_is_shorter_while_most_is_lost(then: float | None, expected: int) -> None:
    found = periods(Repetition(CONFIG), [share(0.9), *[then] * 200])
    assert found[0] == SHORT
    assert found[1:] == [expected] * 200


@pytest.mark.parametrize("loss", [0.82, 0.9, 0.97])
def test_a_link_that_the_repetition_overloads_gets_little_more_load(loss: float) -> None:
    """As many transmissions arrive as before, so of those that are sent a smaller part does."""
    repetition, one, found = Repetition(CONFIG), share(loss), list[int]()
    while len(found) < 2000:
        repetition.update(len(found) * LENGTH, one)
        found.append(repetition.period)
        arrives = (1.0 - loss) * repetition.period / USUAL
        one = 1.0 - (1.0 - arrives) ** (LENGTH / repetition.period)
    assert 0.0 < found.count(SHORT) / len(found) <= 4.2 / 19.0


def test_an_overload_that_comes_later_is_noticed() -> None:
    repetition = Repetition(CONFIG)
    assert set(periods(repetition, [share(0.9), *[share(0.9, SHORT)] * 60])) == {SHORT}
    found = periods(repetition, [share(0.9)] * 160, 61 * LENGTH)
    assert USUAL in found


def test_a_loss_that_grows_is_no_overload() -> None:
    grows = [share(loss) for loss in np.linspace(0.81, 0.9, 10)]
    found = periods(Repetition(CONFIG), [*grows, *[share(0.9, SHORT)] * 100])
    assert set(found) == {SHORT}


@given(st.sets(st.integers(0, 23), min_size=1), st.integers(1, 20))
def test_the_share_counts_the_epochs_before_the_newest_plan(numbers: set[int], count: int) -> None:
    file = PlanFile()
    for number in numbers:
        file.add(stored(plan(number)))
    last = max(numbers)
    if min(numbers) > last - count:
        assert file.share(LENGTH, count) is None
    else:
        expected = len(numbers & set(range(last - count, last))) / count
        assert file.share(LENGTH, count) == expected


def test_the_share_is_that_of_the_peers_that_are_heard() -> None:
    one = agreements(OWN)
    assert one.peers.received(NOW, 10) is None
    now = NOW + 10 * LENGTH
    for system, step in ((OTHER, 1), (THIRD, 5)):
        for number in range(0, 11, step):
            one.receive_plan(now, system, pack(plan(number, x=4.0 * system)))
    assert one.peers.received(now, 10) == pytest.approx((1.0 + 0.2) / 2)
    one.receive_statement(now, THIRD, Statement(FRAME, epoch(10), epoch(0), away=True))
    assert one.peers.received(now, 10) == 1.0
    assert one.peers.received(now + 5_000_001, 10) is None
    one.receive_statement(now, THIRD, statement(11))
    assert one.peers.received(now, 10) == pytest.approx((1.0 + 0.2) / 2)
    # Its farewell is accepted: it makes no more plans.
    one.receive_plan(now, THIRD, pack(plan(11, x=12.0)))
    answer = Entry(OWN, (), (epoch(11), epoch(0)))
    one.receive_statement(now + LENGTH, THIRD, statement(11, answer, farewell=True))
    assert one.peers.received(now, 10) == 1.0


class Datagrams(Swarm):
    """Eight on a ring change sides from ``BEGINS`` on; all messages of one step are lost together."""

    BEGINS = 4_000_000

    def __init__(self, loss: float, factor: float) -> None:
        angles = 2.0 * np.pi * np.arange(8) / 8
        ring = np.stack((8.0 * np.cos(angles), 8.0 * np.sin(angles), np.full(8, 5.0)), axis=1)
        off = np.random.default_rng(10).uniform(-0.3, 0.3, (8, 3)) * np.array([1.0, 1.0, 0.0])
        settings = {"repeat_in_loss": factor}
        super().__init__(ring + off, Rough(loss), [Habits()] * 8, 10, planar=True, settings=settings)
        self.goals = ring * np.array([-1.0, -1.0, 1.0])
        self.transmitted: Counter[tuple[int, int]] = Counter()
        """Number of plans that were transmitted, by vehicle and second."""
        self._step: dict[int, tuple[int, list[bool]]] = {}

    def fly(self, until: int) -> None:
        starts = [vehicle.place for vehicle in self.vehicles]
        self.run(until, lambda t, system: (self.goals if t >= self.BEGINS else starts)[system - 1])

    def record(self, since: int, one: Vehicle) -> None:
        """Nothing, because this takes the most time; ``test_swarm`` checks what is agreed on the way."""

    def _carry(self, since: int, sender: Vehicle, message: Tunnel) -> None:
        if self._step.get(sender.system, (-1,))[0] != since:
            received = (self._rng.random(len(self.vehicles)) >= self._rough.loss).tolist()
            self._step[sender.system] = since, received
        self.transmitted[sender.system, since // 1_000_000] += message.payload_type == PAYLOAD_TYPE
        for receiver, arrives in zip(self.vehicles, self._step[sender.system][1], strict=True):
            if arrives and receiver is not sender:
                heappush(receiver.inbox, (since + TICK, next(self._serial), message))


def test_with_six_of_ten_lost_nothing_changes() -> None:
    with_it, without = Datagrams(0.6, 2.5), Datagrams(0.6, 1.0)
    for swarm in (with_it, without):
        swarm.fly(6_500_000)
    assert with_it.digest() == without.digest()


@pytest.mark.slow
def test_with_nine_of_ten_lost_eight_change_sides_in_three_times_the_time_without_loss() -> None:
    """Without loss it takes 6.3 s."""
    swarm = Datagrams(0.9, 2.5)
    until = swarm.BEGINS + 18_900_000
    swarm.fly(until)
    assert swarm.least() >= swarm.d - swarm.exact
    for vehicle, goal in zip(swarm.vehicles, swarm.goals, strict=True):
        now = BEGIN + until
        there = horizon_of(vehicle.plan(now - now % LENGTH)).at(now)
        assert np.linalg.norm(there.position - goal) < 0.3
    # Each transmission has the newest plan and one of those before; a new plan is transmitted at once.
    most = 2 * (1_000_000 // SHORT + 1_000_000 // LENGTH)
    assert all(number <= most for number in swarm.transmitted.values())
