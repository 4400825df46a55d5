"""The theorem: whatever the channel does and whoever stops, any two plans that are flown are apart at all
times; and the steps of its proof, each on its own."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from companion.avoidance.certified.committed import rests
from companion.avoidance.certified.negotiation import Negotiation
from companion.avoidance.certified.peer import Peer
from companion.avoidance.certified.peer_plans import StoredPlan
from companion.values.horizon import Array
from tests.companion.avoidance.certified.draws import UNTIL, goals, starts, swarms
from tests.companion.avoidance.certified.flights import fly
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import NEVER, Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

FLIGHTS = settings(max_examples=20, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
ROUGH = [
    Rough(loss, delay, 0.2, ((2_000_000, 3_000_000, frozenset({1, 2})),))
    for loss, delay in product((0.0, 0.3, 0.8), (0, 300_000))
]


def circle(vehicles: int, radius: float) -> Array:
    angles = 2.0 * np.pi * np.arange(vehicles) / vehicles
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(vehicles, 5.0)], axis=1)


def flown(rough: Rough, seed: int, *, vehicles: int = 4) -> Swarm:
    swarm = Swarm(starts(vehicles, seed), rough, [Habits()] * vehicles, seed)
    swarm.run(UNTIL, goals(seed))
    return swarm


def check_arrived(swarm: Swarm, goal: Array, seconds: int) -> None:
    """Of ``swarm``, which has flown for ``seconds``, all that are not frozen rest at ``goal`` (k, 3), m."""
    last = EPOCH + seconds * 1_000_000 - swarm.config.certified.epoch_us
    chosen = [vehicle for vehicle in swarm.vehicles if not vehicle.habits.frozen]
    ends = np.array([vehicle.plan(last).positions_m()[1] for vehicle in chosen])
    assert np.linalg.norm(ends - [goal[v.system - 1] for v in chosen], axis=1).max() < 0.2


@FLIGHTS
@given(swarms())
def test_any_two_plans_are_apart_whatever_happens(swarm: Swarm) -> None:
    """Two that may plan keep an agreement in common, of the plans that are flown, and keep to its planes."""
    assert not swarm.faults()


@pytest.mark.parametrize("rough", [Rough(0.3, 300_000, 0.2), Rough(0.0, 40_000)])
def test_what_is_settled_leaves_nothing_to_negotiate(rough: Rough, monkeypatch: pytest.MonkeyPatch) -> None:
    """Looking at each peer after each message gives the same messages, byte by byte."""

    def sent() -> list[bytes]:
        swarm = Swarm(starts(3, 5), rough, [Habits(), Habits(leaves=2_500_000), Habits()], 5)
        swarm.run(4_000_000, goals(5))
        return swarm.sent

    looked, expected = 0, sent()
    advance = Negotiation.advance

    def always(self: Negotiation, now: int, peer: Peer, newest: StoredPlan, since: int) -> None:
        nonlocal looked
        advance(self, now, peer, newest, since)
        looked += peer.settled is not None
        peer.settled = None

    monkeypatch.setattr(Negotiation, "advance", always)
    assert sent() == expected
    assert looked > 100


@pytest.mark.slow
@FLIGHTS
@given(swarms(leave=True))
def test_they_are_also_where_some_leave(swarm: Swarm) -> None:
    """Who leaves flies its last plan to the end, and all others count on that; it may come back."""
    assert not swarm.faults()


@pytest.mark.slow
@FLIGHTS
@given(swarms(leave=True))
def test_who_lacks_an_agreement_does_not_replan(swarm: Swarm) -> None:
    everybody = {vehicle.system for vehicle in swarm.vehicles}
    for made in swarm.made():
        assert made.beside.keys() | made.left.keys() == everybody - {made.system}
        assert not made.beside.keys() & made.left.keys()
        assert all(made.beside.values())


AWAY = [
    Habits(leaves=1_000_000, returns=1_300_000),
    Habits(leaves=1_190_000, returns=1_490_000),
]
"""Two that are away together. Each hears the other's farewell."""


def test_two_that_were_away_together_and_do_not_hear_each_other_since_stay_apart() -> None:
    """From its return on nothing of 1 is heard, and from 1.45 s on it hears nothing."""
    rough = Rough(cuts=((1_450_000, NEVER, frozenset({1})),), mute=((1_300_000, NEVER, 1),))
    swarm = Swarm(np.array([[0.0, 0.0, 5.0], [4.0, 0.0, 5.0]]), rough, AWAY, 0)
    before = np.array([[2.0, 3.0, 5.0], [2.0, 6.0, 5.0]])
    after = np.array([9.0, 4.5, 5.0])
    swarm.run(8_000_000, lambda since, system: after if since > 1_300_000 else before[system - 1])
    assert not swarm.faults()


def test_two_that_were_away_together_plan_again_once_they_hear_each_other() -> None:
    swarm = Swarm(np.array([[0.0, 0.0, 5.0], [4.0, 0.0, 5.0]]), Rough(), AWAY, 0)
    swarm.run(5_000_000, lambda _since, system: np.array([2.0, 3.0 * system, 5.0]))
    assert not swarm.faults()
    for vehicle in swarm.vehicles:
        assert any(made.since > 3_000_000 for made in vehicle.made)


def test_who_returns_and_hears_nobody_makes_no_plan() -> None:
    """Not even if all others had left before: they may have returned."""
    left = Habits(leaves=1_000_000, returns=4_000_000)
    rough = Rough(cuts=((2_000_000, NEVER, frozenset({1})),))
    swarm = Swarm(circle(2, 6.0), rough, [Habits(leaves=1_500_000, returns=2_500_000), left], 0)
    swarm.run(6_000_000, lambda since, system: np.array([0.0, 0.0, 5.0]))
    assert not [made for made in swarm.vehicles[0].made if made.since > 1_500_000]
    assert not swarm.faults()


def test_who_returns_flies_once_those_that_have_left_answer_it() -> None:
    leaving = [Habits(leaves=1_500_000, returns=2_500_000), Habits(leaves=1_000_000)]
    swarm = Swarm(circle(2, 6.0), Rough(0.5, 100_000), leaving, 0)
    swarm.run(6_000_000, lambda since, system: np.array([-1.0, since / 4e6, 5.0]))
    assert any(made.since > 2_500_000 and made.left for made in swarm.vehicles[0].made)
    assert not swarm.faults()


@pytest.mark.slow
@FLIGHTS
@given(st.integers(0, 2**16))
def test_who_restarts_gives_no_epoch_a_second_plan(seed: int) -> None:
    """At any time, and however soon; and all others are apart, also from it when it flies among them."""
    swarm = fly(seed, "quick")
    assert not swarm.faults()


@FLIGHTS
@given(swarms(leave=True))
def test_every_plan_follows_from_the_one_before_it(swarm: Swarm) -> None:
    """The state at its beginning is that of the last plan there, and it ends at rest."""
    step = swarm.config.certified.epoch_us
    for vehicle in swarm.vehicles:
        epochs = sorted(vehicle.plans)
        for before, epoch in pairwise(epochs):
            knots = (epoch - before) // swarm.config.certified.dt_us
            first, second = vehicle.plans[before], vehicle.plans[epoch]
            there = first.states()[min(knots, len(first.accelerations))]
            np.testing.assert_array_equal(second.states()[0], there)
            assert rests(second)
            assert epoch % step == 0


@pytest.mark.slow
@pytest.mark.parametrize("rough", ROUGH, ids=lambda rough: f"{rough.loss}-{rough.delay}")
def test_seeded_flights_are_apart_and_get_somewhere(rough: Rough) -> None:
    made = 0
    for seed in range(2):
        swarm = flown(rough, seed)
        assert not swarm.faults()
        made += len(swarm.made())
    assert made > 0


def test_these_flights_are_close_ones() -> None:
    """They come as near as they may, or the laws are idle."""
    flights = [flown(Rough(), seed) for seed in range(6)]
    assert min(flight.least() for flight in flights) < flights[0].d + 0.02


@pytest.mark.parametrize(
    ("radius", "seed", "seconds"),
    [
        pytest.param(4.0, 1, 10, id="diameter 8 m"),
        pytest.param(8.0, 0, 8, id="radius 8 m"),
        pytest.param(8.0, 1, 8, id="radius 8 m, other phases"),
    ],
)
def test_eight_opposite_on_a_circle_arrive_in_time(radius: float, seed: int, seconds: int) -> None:
    places = circle(8, radius)
    goal = places * (-1.0, -1.0, 1.0)
    swarm = Swarm(places, Rough(), [Habits()] * 8, seed)
    swarm.run(seconds * 1_000_000, lambda since, system: goal[system - 1])
    check_arrived(swarm, goal, seconds)
    assert not swarm.faults()
    assert all(made.found for made in swarm.made())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rough", "seconds"),
    [
        pytest.param(Rough(0.6, 100_000), 11, id="60 % lost, up to 100 ms late"),
        pytest.param(Rough(0.0, 300_000), 11, id="up to 300 ms late, epochs of 200 ms"),
    ],
)
def test_they_arrive_on_links_that_lose_and_delay(rough: Rough, seconds: int) -> None:
    places = circle(8, 4.0)
    goal = places * (-1.0, -1.0, 1.0)
    swarm = Swarm(places, rough, [Habits()] * 8, 1)
    swarm.run(seconds * 1_000_000, lambda since, system: goal[system - 1])
    assert not swarm.faults()
    check_arrived(swarm, goal, seconds)


def test_one_that_is_silent_for_ever_does_not_stop_the_others() -> None:
    """Of eight that cross a circle one is frozen on the way. The others keep to their sides of it for good,
    and reach every place there, also past each other: two exchange their places, five return to theirs."""
    stops, seconds = 2_000_000, 12
    places = circle(8, 6.0)
    after = places[[0, 1, 2, 5, 4, 3, 6, 7]]
    swarm = Swarm(places, Rough(), [Habits(frozen=((stops, NEVER),)), *[Habits()] * 7], 1)
    swarm.run(
        seconds * 1_000_000,
        lambda since, system: after[system - 1] if since > stops else -places[system - 1] * (1, 1, -1),
    )
    assert not swarm.faults()
    check_arrived(swarm, after, seconds)
    for vehicle in swarm.vehicles[1:]:
        assert sum(made.found for made in vehicle.made if made.since > stops) > 40


@pytest.mark.parametrize("rough", ROUGH[:3:2], ids=["clear", "lossy"])
def test_the_same_seed_gives_the_same_bytes(rough: Rough) -> None:
    first, second = (flown(rough, 7).digest() for _ in range(2))
    assert first == second
    assert first != flown(rough, 8).digest()


def moved(swarm: Swarm, since: int) -> bool:
    """Whether anybody flies another plan than to stand before ``since`` µs."""
    epochs = (epoch for epoch in swarm.epochs() if epoch < EPOCH + since)
    return any(np.ptp(v.plan(epoch).positions_m(), axis=0).any() for epoch in epochs for v in swarm.vehicles)


@pytest.mark.parametrize(
    "last",
    [Habits(on=2_000_000), Habits(steers=2_000_000), Habits(frozen=((0, 2_000_000),))],
    ids=["late", "not steering", "frozen"],
)
def test_nobody_moves_before_all_that_are_expected_are_there(last: Habits) -> None:
    """Not even those that have heard each other."""
    swarm = Swarm(starts(4, 1), Rough(), [*[Habits()] * 3, last], 1)
    swarm.run(4_000_000, goals(1))
    assert min(made.since for made in swarm.made()) >= 2_000_000
    assert not moved(swarm, 2_000_000)
    assert {made.system for made in swarm.made()} == {1, 2, 3, 4}
    assert moved(swarm, 4_000_000)


def test_nobody_moves_before_all_that_are_expected_are_heard() -> None:
    alone = Rough(cuts=((0, 2_000_000, frozenset({4})),))
    swarm = Swarm(starts(4, 1), alone, [Habits()] * 4, 1)
    swarm.run(4_000_000, goals(1))
    assert not moved(swarm, 2_000_000)
    assert moved(swarm, 4_000_000)


def test_nobody_moves_beside_one_that_does_not_count_with_it() -> None:
    """Who expects nobody and hears nothing counts with nobody, and may move; so all others must not."""
    later = Habits(on=0, steers=600_000)
    swarm = Swarm(starts(3, 1), Rough(deaf=frozenset({3})), [later, later, Habits()], 1, strangers=True)
    swarm.run(3_000_000, goals(1))
    assert {made.system for made in swarm.made()} == {3}


def test_who_left_is_not_waited_for() -> None:
    """Even where most is lost: a farewell is told again and again, with the plan that it goes with."""
    leaving = Habits(leaves=1_000_000)
    swarm = Swarm(starts(3, 2), Rough(0.8, 100_000), [leaving, Habits(), Habits()], 2)
    swarm.run(9_000_000, goals(2))
    assert not swarm.faults()
    for vehicle in swarm.vehicles[1:]:
        assert set(vehicle.flight.agreements.peers.left) == {1}
        assert any(made.since > 4_000_000 for made in vehicle.made)


def test_who_comes_back_makes_no_plan_before_all_others_agree_with_it_anew() -> None:
    """What they stated before its farewell says nothing: here no statement of 2 gets through from then on,
    and nothing of 1 since it is back, but the plans of 2 do."""
    left, back, through = 600_000, 2_600_000, 5_000_000
    rough = Rough(mute=((back, through, 1),), alone=((left, through, 2),))
    swarm = Swarm(circle(2, 6.0), rough, [Habits(leaves=left, returns=back), Habits()], 2)
    swarm.run(8_000_000, lambda since, system: np.array([0.0, 0.0, 5.0]))
    made = {system: [one.since for one in swarm.made() if one.system == system] for system in (1, 2)}
    assert any(back <= since < through for since in made[2])
    assert not any(back <= since < through for since in made[1])
    assert any(since > through for since in made[1])
    assert not swarm.faults()
