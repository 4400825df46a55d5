"""The guard: a held plan ends, a brake comes to rest, a lost vehicle is planned for where it is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.config import CompanionConfig
from companion.flight.guard import Guard, Holding, brake
from companion.values.horizon import Motion, roll_out
from tests.companion.rig import LAWS, ZERO, numbers, vectors

FAR = {"box_min": (-1e4, -1e4, -1e4), "box_max": (1e4, 1e4, 1e4)}
"""Walls that no brake reaches."""
CONFIG = CompanionConfig.model_validate({"limits": FAR})
ESCORT = CompanionConfig.model_validate(
    {
        "horizon": {"dt_us": 80_000},
        "limits": {"u_max": (4.0, 4.0, 4.0), "v_max": (7.0, 7.0, 7.0), "a_total": 6.9, **FAR},
        "tangential": {"force_max": 5.0},
    }
)
SHORT = CompanionConfig.model_validate({"horizon": {"dt_us": 20_000, "steps": 5}, "limits": FAR})
CONFIGS = st.sampled_from([CONFIG, ESCORT, SHORT])
START = 1_767_225_600_000_000
HOLD = CONFIG.guard.hold_us


def under_way():
    return roll_out(START, 100_000, ZERO, np.array([3.0, -1.0, 0.5]), np.full((16, 3), 0.4))


def motion(x=ZERO, v=ZERO):
    return Motion(np.asarray(x, dtype=float), np.asarray(v, dtype=float), ZERO)


@LAWS
@given(x=vectors(50.0), v=vectors(15.0), config=CONFIGS)
def test_a_brake_comes_to_rest_within_its_horizon_and_limits(x, v, config):
    horizon = brake(START, motion(x, v), config)
    np.testing.assert_allclose(horizon.at(START).position, x)
    np.testing.assert_allclose(horizon.at(START).velocity, v)
    np.testing.assert_allclose(horizon.knots[-1, 3:6], ZERO, atol=1e-9)
    hovering = horizon.at(horizon.end + 3_600_000_000)
    np.testing.assert_allclose(hovering.position, horizon.knots[-1, 0:3], atol=1e-5)
    accelerations = np.linalg.norm(horizon.knots[:, 6:9], axis=1)
    speed = np.linalg.norm(v)
    assert accelerations.max() <= config.limits.a_total + 1e-9
    room = config.horizon.steps * config.horizon.dt_us * 1e-6
    if speed <= min(config.limits.u_max) * room:
        assert accelerations.max() <= min(config.limits.u_max) + 1e-9


@LAWS
@given(
    x=st.tuples(numbers(-20.0, 20.0), numbers(-20.0, 20.0), numbers(3.0, 10.0)),
    v=vectors(5.0),
    jerk=st.sampled_from([None, (3.5, 3.5, 3.5)]),
)
def test_a_brake_ends_before_the_wall_where_the_vehicle_can_stop_before_it(x, v, jerk):
    config = CompanionConfig.model_validate({"limits": {"j_max": jerk}})
    limits = config.limits
    low, high = np.array(limits.box_min), np.array(limits.box_max)
    room = np.where(v < 0.0, np.array(x) - low, high - np.array(x))
    assume((v**2 / (2.0 * limits.a_total / np.sqrt(3.0)) + 0.1 * np.abs(v) <= room).all())
    knots = brake(START, motion(x, v), config).knots
    assert (knots[:, 0:3] >= low - 1e-9).all()
    assert (knots[:, 0:3] <= high + 1e-9).all()
    assert np.linalg.norm(knots[:, 6:9], axis=1).max() <= limits.a_total + 1e-9
    np.testing.assert_allclose(knots[-1, 3:6], ZERO, atol=1e-9)


@LAWS
@given(v=vectors(15.0), config=CONFIGS)
def test_a_brake_is_straight_and_only_gets_slower(v, config):
    knots = brake(START, motion(ZERO, v), config).knots
    speeds = np.linalg.norm(knots[:, 3:6], axis=1)
    assert (np.diff(speeds) <= 1e-9).all()
    np.testing.assert_allclose(np.cross(knots[:, 0:3], v), 0.0, atol=1e-6)
    assert (knots[:, 3:6] @ v >= -1e-6).all()


def test_a_brake_fits_the_wire():
    """Neighbours are told of it as of any plan."""
    for config in (CONFIG, ESCORT):
        horizon = brake(START, motion(ZERO, [12.0, 12.0, 12.0]), config)
        assert len(horizon.knots) == config.horizon.steps + 2
        assert horizon.dt % 4 == 0
        assert horizon.dt <= 262_140


def test_a_start_is_a_hover_where_the_vehicle_is():
    guard = Guard(CONFIG)
    guard.start(START, motion([1.0, 2.0, 5.0]))
    np.testing.assert_allclose(guard.horizon.at(START + 10_000_000).position, [1.0, 2.0, 5.0])
    assert guard.state is Holding.FRESH


@LAWS
@given(times=st.lists(st.integers(1, 3 * HOLD), min_size=1, max_size=30).map(sorted), solver=st.booleans())
def test_a_plan_is_held_for_its_time_and_then_braked(times, solver):
    guard, plan = Guard(CONFIG), under_way()
    guard.accept(START, plan)
    braked = None
    for time in times:
        guard.hold(START + time, solver=solver)
        if time <= HOLD:
            assert guard.state is Holding.HELD
            assert guard.horizon is plan
        else:
            assert guard.state is Holding.BRAKING
            # Once: it is not begun anew from where it has got to.
            braked = braked or guard.horizon
            assert guard.horizon is braked
    assert guard.held == len(times)
    assert guard.failures == len(times) * solver
    if braked is not None:
        begun = plan.at(braked.epoch)
        np.testing.assert_allclose(braked.at(braked.epoch).position, begun.position)
        np.testing.assert_allclose(braked.at(braked.epoch).velocity, begun.velocity)
        np.testing.assert_allclose(braked.knots[-1, 3:6], ZERO, atol=1e-9)


def test_a_good_plan_ends_the_brake_and_counts_anew():
    guard, plan = Guard(CONFIG), under_way()
    guard.accept(START, plan)
    guard.hold(START + HOLD + 1, solver=True)
    assert guard.state is Holding.BRAKING
    guard.accept(START + 2 * HOLD, plan)
    assert guard.state is Holding.FRESH
    guard.hold(START + 3 * HOLD, solver=True)
    assert guard.state is Holding.HELD
    assert guard.horizon is plan


def test_nothing_flown_holds_nothing():
    guard = Guard(CONFIG)
    guard.hold(START, solver=False)
    assert guard.horizon is None
    here = motion([1.0, 0.0, 0.0])
    assert guard.anchor(START, here) is here


@LAWS
@given(off=vectors(1.0).filter(lambda d: float(d @ d) > 0.01), distance=numbers(0.0, 5.0))
def test_planning_starts_from_the_plan_inside_the_tube_and_from_the_vehicle_outside(off, distance):
    guard, plan = Guard(CONFIG), under_way()
    guard.accept(START, plan)
    now = START + 250_000
    there = plan.at(now)
    measured = motion(there.position + distance * off / np.linalg.norm(off), [1.0, 1.0, 1.0])
    anchor = guard.anchor(now, measured)
    tube = CONFIG.guard.tube
    if distance < tube - 1e-9:
        np.testing.assert_array_equal(anchor.position, there.position)
        np.testing.assert_array_equal(anchor.velocity, there.velocity)
        assert guard.anchored_anew == 0
    elif distance > tube + 1e-9:
        assert anchor is measured
        assert guard.anchored_anew == 1


@pytest.mark.parametrize("config", [CONFIG, ESCORT, SHORT])
def test_a_brake_from_rest_is_a_hover(config):
    knots = brake(START, motion([1.0, 2.0, 3.0]), config).knots
    assert not knots[:, 3:].any()
    np.testing.assert_array_equal(knots[:, 0:3], np.tile([1.0, 2.0, 3.0], (len(knots), 1)))
