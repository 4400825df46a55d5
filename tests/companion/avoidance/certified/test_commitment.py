"""One vehicle's plans from epoch to epoch: what is told is flown, what is not made anew goes on, and a plan
that was not found is the old one."""

from __future__ import annotations

from contextlib import nullcontext
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic import ValidationError

from companion.avoidance.certified.commitment import Commitment, HoldReason
from companion.avoidance.certified.committed import carried_on, committed, controls, resting, rests, rounding
from companion.avoidance.certified.deadlock import DeadlockTurn
from companion.avoidance.certified.detour import Subgoal
from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.certified.qp import Objective, SeparationQp
from companion.avoidance.certified.separating_planes import Others, agreed_planes, hull_distance
from companion.config import CompanionConfig
from companion.config.certified import CertifiedConfig
from companion.config.planning import HorizonConfig, LimitsConfig
from companion.values.horizon import Array, Motion, roll_out
from companion.ways.way import Way
from mavlink_bridge.messages import Message, Source, Tunnel
from mavlink_bridge.wire.agreements import unpack
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS
from tests.companion.avoidance.certified.rough import FLEET

LENGTH = 400_000
SHIFT = LENGTH // DT
CONFIG = CertifiedConfig(dt_us=DT, epoch_us=LENGTH)
HERE = np.array([0.0, 0.0, 5.0])
NOBODY = Others(*np.zeros((2, 0, STEPS, 3, 3)), np.zeros((0, STEPS)))
seeds = st.integers(0, 2**32 - 1)
POST = {"kind": "post", "at": [8.0, 0.0], "radius": 1.0, "height": 10.0}
choices = st.lists(st.sampled_from(["plan", "hold", "wait", "sleep"]), max_size=12)


def commitment() -> Commitment:
    program = SeparationQp(STEPS, LimitsConfig(), CONFIG)
    kept = Commitment(CONFIG, program, DeadlockTurn(CONFIG.deadlock), 7)
    kept.begin(EPOCH, HERE)
    return kept


def vector(x: float, y: float, z: float) -> Array:
    return np.array([x, y, z])


def towards(goal: Array) -> Objective:
    places = np.broadcast_to(goal, (STEPS, 3))
    return Objective(places, np.zeros((STEPS, 3)), np.zeros((STEPS, 3)))


def replan(kept: Commitment, goal: Array, others: Others = NOBODY) -> bool:
    return kept.replan(towards(goal), Subgoal(goal, 0.0), others)


@given(choices, st.integers(0, 2**16))
def test_what_is_told_for_an_epoch_is_flown_in_it(ways: list[str], seed: int) -> None:
    """Whatever is done in each, and where whole epochs pass by."""
    kept, rng, now = commitment(), np.random.default_rng(seed), EPOCH
    announced = {}
    for way in ways:
        now += LENGTH * (4 if way == "sleep" else 1) - int(rng.integers(0, 1000))
        if kept.turn(now):
            if way == "plan":
                replan(kept, HERE + rng.normal(size=3))
            elif way == "hold":
                kept.carry_on(HoldReason.MISSING)
        current = kept.current
        assert current is not None
        assert current.epoch == kept.epoch(now)
        assert announced.setdefault(current.epoch, current) == current
        plan = kept.announced()
        assert plan is not None
        assert rests(plan)
        assert announced.setdefault(plan.epoch, plan) == plan
    for before, after in pairwise(sorted(announced)):
        knots = (after - before) // DT
        assert carried_on(announced[before], knots).position == announced[after].position
        assert carried_on(announced[before], knots).velocity == announced[after].velocity


@given(seeds)
def test_a_plan_of_limited_length_goes_where_a_goal_is_turned_back_to(seed: int) -> None:
    """It is the plan of a vehicle whose goal lies there."""
    rng = np.random.default_rng(seed)
    aim, goal = rng.normal(scale=3.0, size=(2, 3))
    if aim @ goal >= 0.0:
        goal = -goal
    made = []
    for place in (HERE + goal, HERE + aim):
        program, turn = SeparationQp(STEPS, LimitsConfig(), CONFIG), DeadlockTurn(CONFIG.deadlock)
        kept = Commitment(CONFIG, program, turn, 7, sides=np.array([2.0, 2.0, 0.5]))
        kept.begin(EPOCH, HERE)
        kept.turn(EPOCH + 2 * LENGTH)
        assert kept.replan(towards(HERE + aim), Subgoal(place, 0.0), NOBODY)
        made.append(kept.announced())
    assert made[0] == made[1]


def test_the_horizon_is_this_plan_and_then_the_next() -> None:
    kept = commitment()
    replan(kept, HERE + vector(4.0, 2.0, 1.0))
    kept.turn(EPOCH + LENGTH)
    replan(kept, HERE + vector(-4.0, 2.0, 1.0))
    horizon, current, following = kept.horizon(), kept.current, kept.following
    assert horizon is not None
    assert current is not None
    assert following is not None
    end = horizon.knots[:, 0:3]
    np.testing.assert_array_equal(end[:SHIFT], current.positions_m()[:SHIFT])
    np.testing.assert_array_equal(end[SHIFT:], following.positions_m())
    assert horizon.epoch + SHIFT * DT == following.epoch


def test_a_plan_that_is_not_found_is_the_old_one() -> None:
    kept = commitment()
    replan(kept, HERE + vector(4.0, 2.0, 1.0))
    kept.turn(EPOCH + LENGTH)
    expected = kept.start()
    assert not replan(kept, HERE * np.nan)
    assert kept.following == expected
    assert (kept.held[HoldReason.UNSOLVED], sum(kept.held.values())) == (1, 1)


def test_anew_from_where_it_is_is_to_rest_and_from_the_next_epoch_on() -> None:
    """No step of the proof, but a plan like all others."""
    kept = commitment()
    now = EPOCH + 100_000
    measured = Motion(HERE + vector(1.0, 2.0, 0.0), np.array([1.5, -1.0, 0.5]), np.zeros(3))
    kept.anchor(now, measured)
    plan = kept.following
    assert plan is not None
    assert plan.epoch == EPOCH + LENGTH
    assert rests(plan)
    np.testing.assert_allclose(plan.position_m, measured.position + 0.3 * measured.velocity, atol=1e-4)
    np.testing.assert_allclose(plan.velocity_m_s, measured.velocity, atol=1e-3)
    kept.turn(EPOCH + LENGTH)
    assert replan(kept, HERE)


def standing(own: Array, apart: Array, *, shares: bool) -> Others:
    """One that stands ``apart`` (3,) m from ``HERE``, from which 2 m are to be kept; ``own`` (n, 3, 3), m."""
    there = np.broadcast_to(HERE + apart, (STEPS, 3, 3))
    if shares:
        return NOBODY._replace(agreed=agreed_planes(own, there, 2.0)[None])
    return Others(own[None], there[None], np.full((1, STEPS), 2.0))


@example(254636, 1.0, False)
@example(254636, 1.0, True)
@given(seeds, st.sampled_from([1.0, 1.5, 1.999, 2.0, 2.001, 2.01, 2.3]), st.booleans())
def test_pulled_through_one_that_is_near_it_makes_plans_and_never_comes_nearer(
    seed: int, near: float, shares: bool
) -> None:
    """Nearer than it is, if that is too near; nor does rounding freeze it where it has no room."""
    kept, rng = commitment(), np.random.default_rng(seed)
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    goal = HERE + 6.0 * way + rng.normal(size=3)
    place = HERE + near * way
    least = hull_distance(kept.own() - place).min()
    for epoch in range(6):
        kept.turn(EPOCH + epoch * LENGTH)
        assert replan(kept, goal, standing(kept.own(), near * way, shares=shares))
        assert kept.following is not None
        distance = hull_distance(controls(kept.following) - place)
        assert distance.min() >= min(least, 2.0) - 1e-9


@given(seeds)
def test_rounding_moves_control_points_no_further_than_it_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start = resting(EPOCH, DT, STEPS, HERE, 7)
    exact = rng.uniform(-2, 2, (STEPS, 3))
    exact[-1] = -exact[:-1].sum(axis=0)
    points = horizon_points(exact)
    moved = np.linalg.norm(controls(committed(start, exact)) - points, axis=-1)
    bound = rounding(STEPS, DT)
    assert (moved[:-1] <= bound[:-1] + 1e-9).all()
    # The last one is what brings it to rest.
    assert (moved[-1] <= 1.1 * bound[-1]).all()


def horizon_points(accelerations: Array) -> Array:
    knots = roll_out(EPOCH, DT, HERE, np.zeros(3), accelerations).knots
    between = knots[:-1, 0:3] + 0.5e-6 * DT * knots[:-1, 3:6]
    return np.stack([knots[:-1, 0:3], between, knots[1:, 0:3]], axis=1)


def tunnels(flight: CertifiedFlight, now: int) -> list[Message]:
    return [message for message in flight.messages(now) if isinstance(message, Tunnel)]


class TestStanding:
    """Of ``CertifiedFlight``: before it steers, and when it steers again."""

    def flight(self) -> CertifiedFlight:
        config = CompanionConfig(task="goto", avoidance="certified", certified=CONFIG)
        return CertifiedFlight(config, Source(1, 195), FLEET)

    def test_nobody_is_told_of_a_plan_that_is_not_flown_yet(self) -> None:
        flight = self.flight()
        flight.stand(EPOCH, HERE)
        assert not tunnels(flight, EPOCH)
        flight.due(EPOCH + DT)
        assert len(tunnels(flight, EPOCH + DT)) == 2

    def test_within_its_tube_it_stands_by_its_plan(self) -> None:
        flight = self.flight()
        flight.stand(EPOCH, HERE)
        stood = flight.commitment.current
        assert stood is not None
        for step in range(1, 60):
            wandered = HERE + 0.9 * CONFIG.tube * np.array([np.sin(step), np.cos(step), 0.0])
            flight.stand(EPOCH + step * 50_000, wandered)
            current = flight.commitment.current
            assert current is not None
            assert current.position == stood.position

    @pytest.mark.parametrize("hovers", [False, True])
    def test_flown_by_another_controller_it_prepares_its_way_at_most_once(
        self, hovers: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """That is once it has stood for a second, because a preparation takes 0.1 s."""
        heights: list[float] = []
        monkeypatch.setattr(Way, "prepare", lambda _way, height: heights.append(height))
        config = CompanionConfig.model_validate(
            {"task": "goto", "avoidance": "certified", "planar": True, "way": {}, "obstacles": [POST]}
        )
        flight = CertifiedFlight(config, Source(1, 195), FLEET)
        flight.stand(EPOCH, HERE)
        # Half a unit of the wire.
        unit = 0.5e-3 * (1e-6 * config.certified.dt_us) ** 2
        assert heights.pop() == pytest.approx(HERE[2], abs=0.5 * unit + 1e-9)
        place = HERE
        for step in range(1, 200):
            moves = not hovers or step % 50 < 25
            place = place + vector(0.2, 0.0, 0.05) * moves
            flight.stand(EPOCH + step * 50_000, place)
        assert len(heights) == hovers
        if hovers:
            assert heights[0] == pytest.approx(HERE[2] + 24 * 0.05, abs=CONFIG.tube)

    def test_outside_it_stands_where_it_is_but_keeps_to_what_was_told_for_the_epoch(self) -> None:
        flight = self.flight()
        away = HERE + vector(2.0, 0.0, 0.0)
        flight.stand(EPOCH, HERE)
        flight.due(EPOCH)
        flight.messages(EPOCH)
        announced = flight.commitment.announced()
        assert announced is not None
        for now in (EPOCH + LENGTH - 4, EPOCH + LENGTH):
            flight.stand(now, away)
            assert (flight.commitment.following or flight.commitment.current) == announced
        now = announced.epoch + LENGTH
        flight.stand(now, away)
        origin = FLEET.fingerprint
        assert flight.commitment.current == resting(now, DT, STEPS, away, origin)
        # It is away, and begins anew: no plan is told before it steers.
        (away_from_it,) = tunnels(flight, now)
        assert unpack(away_from_it.payload).away

    def test_to_leave_a_plan_that_was_told_is_to_plan_anew_and_counted_once(self) -> None:
        """Of plans that nobody was told, as on the way up, nothing follows."""
        flight = self.flight()
        for step in range(10):
            flight.stand(EPOCH + step * LENGTH, HERE + vector(step, 0.0, 0.0))
        assert flight.commitment.anchored_anew == 0
        now = EPOCH + 10 * LENGTH
        flight.due(now)
        flight.messages(now)
        flight.stand(now + LENGTH, HERE + vector(9.0, 0.0, 0.0))
        assert flight.commitment.anchored_anew == 0
        for step in range(3, 6):
            flight.stand(now + step * LENGTH, HERE + vector(0.0, step, 0.0))
        assert flight.commitment.anchored_anew == 1

    def test_who_steers_no_more_tells_no_plan_but_that_it_is_away_or_a_farewell(self) -> None:
        """It may be flown by hand: nobody is to take its last plan for what it flies."""
        for leaving in (False, True):
            flight = self.flight()
            flight.stand(EPOCH, HERE)
            flight.due(EPOCH)
            assert len(tunnels(flight, EPOCH)) == 2
            for now in range(EPOCH + 60_000, EPOCH + 4 * LENGTH, 60_000):
                said = [one for one in flight.messages(now, farewell=leaving) if isinstance(one, Tunnel)]
                told = unpack(said[-1].payload)
                assert (len(said), told.away) == ((2, False) if leaving else (1, True))
                if now >= EPOCH + 2 * LENGTH:
                    assert told.farewell == leaving
            # Landed, and handed over: the farewell was the last that was heard of it.
            assert bool(tunnels(flight, EPOCH + 5 * LENGTH)) != leaving
            now = EPOCH + 6 * LENGTH
            flight.stand(now, HERE)
            assert bool(tunnels(flight, now)) != leaving
            flight.due(now + 20_000)
            assert len(tunnels(flight, now + 20_000)) == 2


def test_an_epoch_is_no_longer_than_a_plan() -> None:
    certified = CertifiedConfig(dt_us=DT, epoch_us=1_000_000)
    with pytest.raises(ValidationError, match="epoch_us"):
        CompanionConfig(horizon=HorizonConfig(steps=3), certified=certified)


@pytest.mark.parametrize(("clock_us", "allowed"), [(39_000, True), (40_000, False)])
def test_two_clocks_and_a_late_step_differ_by_less_than_an_epoch(clock_us: int, allowed: bool) -> None:
    certified = {"dt_us": 100_000, "epoch_us": 100_000, "clock_us": clock_us}
    given = {"certified": certified, "rates": {"setpoint_us": 20_000}}
    with nullcontext() if allowed else pytest.raises(ValidationError, match="clock_us"):
        CompanionConfig.model_validate(given)
