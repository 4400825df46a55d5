"""Whatever others do, no plan of the field leaves the box or its range of speeds, on any axis."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from companion.avoidance.field.planner import Planner, standing
from companion.avoidance.field.walls import Walls
from companion.config import CompanionConfig
from companion.values.horizon import roll_out
from companion.values.obstacles import Obstacles
from tests.companion.rig import LAWS, QUICK, ZERO, vectors
from tests.scenarios.adversary import shipped

STEPS, DT = 16, 100_000
CONFIGS = {
    "paper": CompanionConfig(),
    "slow": CompanionConfig.model_validate({"limits": {"v_max": (2.0, 2.0, 1.0)}}),
    "lopsided": CompanionConfig.model_validate(
        {
            "limits": {
                "u_max": (2.0, 2.0, 6.0),
                "u_min": (-2.0, -3.0, -4.0),
                "v_max": (2.0, 1.0, 2.0),
                "v_min": (-1.0, -3.0, -0.5),
                "a_total": 8.0,
            },
            "tangential": {"force_max": 7.0},
        }
    ),
    "shipped": CompanionConfig.model_validate(shipped("ardupilot")),
}
PERIODS = st.sampled_from([20_000, 50_000, 100_000])


class Adversaries:
    """Neighbours that are where they press most, and somewhere else in the next moment."""

    def __init__(self, config, seed):
        self._field, self._chance = config.field, np.random.default_rng(seed)
        self._left = 0

    def beside(self, here, prediction, period):
        """Obstacles for a vehicle at ``here`` that expects to be at ``prediction`` (16, 3)."""
        chance = self._chance
        if self._left <= 0:
            self._left = int(chance.uniform(100_000, 1_500_000))
            count = int(chance.integers(0, 4))
            off = chance.normal(size=(count, 3))
            off[:, 2] += chance.choice([0.0, 1.0, 2.0])
            lengths = np.linalg.norm(off, axis=1, keepdims=True)
            self._off = off / lengths * chance.uniform(0.2, 4.0, (count, 1))
            self._speed = chance.normal(size=(count, 3)) * chance.choice([0.0, 1.0, 5.0])
            self._follows, self._from = chance.random() < 0.6, here.copy()
        self._left -= period
        path = prediction if self._follows else np.tile(self._from, (STEPS, 1))
        drift = self._speed[:, None, :] * (1e-6 * DT * np.arange(STEPS))[None, :, None]
        places, count = self._off[:, None, :] + path[None] + drift, len(self._off)
        distances = np.full(count, self._field.d_min), np.full(count, self._field.d_safe)
        return Obstacles(tuple(range(20, 20 + count)), places, *distances)


@QUICK
@example(seed=283, name="paper", period=50_000)
@given(seed=st.integers(0, 2**32 - 1), name=st.sampled_from(sorted(CONFIGS)), period=PERIODS)
def test_no_neighbours_press_a_plan_through_a_wall_or_beyond_its_speeds(seed, name, period):
    config = CONFIGS[name]
    limits = config.limits.within(config.field.margin(1))
    low, high = np.array(limits.box_min), np.array(limits.box_max)
    slowest, fastest = np.array(limits.least_v), np.array(limits.v_max)
    chance, adversaries = np.random.default_rng(seed), Adversaries(config, seed)
    planner, horizon, now = Planner(config), None, 0
    position, velocity, acceleration = np.append(ZERO[:2], chance.uniform(low[2], low[2] + 5.0)), ZERO, ZERO
    goal = low + chance.uniform(0.0, 1.0, 3) * np.minimum(high - low, 8.0)
    for _ in range(100):
        expected = np.tile(position, (STEPS, 1)) if horizon is None else horizon.positions(now, STEPS, DT)
        others = adversaries.beside(position, expected, period)
        plan = planner.plan(now, position, velocity, expected, standing(goal), others, acceleration)
        horizon, now = plan.horizon, now + period
        position, velocity, acceleration = horizon.at(now)
        assert (position >= low - 1e-6).all()
        assert (position <= high + 1e-6).all()
        assert (velocity >= slowest - 2e-6).all()
        assert (velocity <= fastest + 2e-6).all()
        assert np.linalg.norm(acceleration) <= limits.a_total * (1.0 + 1e-6)


@LAWS
@given(
    room=vectors(7.0),
    velocity=vectors(5.0),
    pushes=st.lists(vectors(7.0), min_size=STEPS, max_size=STEPS),
    name=st.sampled_from(["paper", "slow", "lopsided"]),
)
def test_any_push_is_held_where_the_vehicle_can_stop(room, velocity, pushes, name):
    """In any corner of the box, ``room`` from its walls: their signs choose the corner."""
    limits = CONFIGS[name].limits
    slowest, fastest = np.array(limits.least_v), np.array(limits.v_max)
    braking = np.minimum(np.maximum(limits.weakest, 0.5 * limits.a_total), limits.a_total / np.sqrt(3.0))
    low, high = np.array(limits.box_min), np.array(limits.box_max)
    position = np.clip(np.where(room < 0.0, high + room, low + room), low, high)
    room = np.where(velocity < 0.0, position - low, high - position)
    assume(
        (velocity**2 / braking + 0.2 * np.abs(velocity) <= room).all()
        and (velocity <= fastest).all()
        and (velocity >= slowest).all()
    )
    pushed = np.array(pushes)
    pushed *= limits.a_total / np.maximum(np.linalg.norm(pushed, axis=1, keepdims=True), limits.a_total)
    kept = pushed.copy()
    amended = Walls(limits, 0.1, 1.6).keep(position, velocity, ZERO, 0.1, kept)
    knots = roll_out(0, DT, position, velocity, kept).knots
    assert (knots[:, 0:3] >= np.array(limits.box_min) - 1e-5).all()
    assert (knots[:, 0:3] <= np.array(limits.box_max) + 1e-5).all()
    assert (knots[:, 3:6] <= fastest + 1e-5).all()
    assert (knots[:, 3:6] >= slowest - 1e-5).all()
    assert np.linalg.norm(kept, axis=1).max() <= limits.a_total + 1e-9
    assert (amended > 0) == (kept != pushed).any()


@pytest.mark.parametrize("name", sorted(CONFIGS))
def test_a_plan_that_breaks_nothing_is_left_as_it_is(name):
    limits = CONFIGS[name].limits
    a = np.random.default_rng(1).normal(size=(STEPS, 3)) * 0.1
    before = a.copy()
    assert Walls(limits, 0.1, 0.6).keep(np.array([0.0, 0.0, 6.0]), ZERO, ZERO, 0.02, a) == 0
    np.testing.assert_array_equal(a, before)


def test_a_push_through_the_floor_is_dropped_and_the_way_along_it_left():
    limits = CompanionConfig().limits
    a = np.tile([1.0, -0.5, -4.0], (STEPS, 1))
    Walls(limits, 0.1, 0.6).keep(np.array([0.0, 0.0, 3.0]), ZERO, ZERO, 0.1, a)
    np.testing.assert_allclose(a, np.tile([1.0, -0.5, 0.0], (STEPS, 1)), atol=1e-4)


def test_a_plan_that_begins_below_the_floor_goes_no_further():
    limits = CompanionConfig().limits
    a = np.tile([0.0, 0.0, -2.0], (STEPS, 1))
    start = np.array([0.0, 0.0, 2.0])
    Walls(limits, 0.1, 0.6).keep(start, ZERO, ZERO, 0.1, a)
    assert roll_out(0, DT, start, ZERO, a).knots[:, 2].min() >= 2.0 - 1e-5
