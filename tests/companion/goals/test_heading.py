"""The yaw: towards the target, the short way, never faster than the vehicle can."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.planning import HeadingConfig, HorizonConfig
from companion.goals.heading import Heading
from tests.companion.rig import LAWS, QUICK, numbers

CONFIG, HORIZON = HeadingConfig(), HorizonConfig()
N, DT = HORIZON.steps + 1, HORIZON.dt_us
PERIOD = 10_000
START = 1_767_225_600_000_000
TARGETS = np.zeros((N, 3))
ANGLES = numbers(-math.pi, math.pi)


def made(yaw, config=CONFIG):
    heading = Heading(config, HORIZON)
    heading.reset(yaw)
    return heading


def facing(bearing, distance=4.0):
    """Own positions (N, 3) from which the target at the origin lies at ``bearing``."""
    return np.tile([-distance * math.cos(bearing), -distance * math.sin(bearing), 5.0], (N, 1))


def turned(heading, bearing, seconds, period=PERIOD):
    """Every planned yaw of a turn towards a bearing that stays."""
    seen = []
    for now in range(START, START + round(seconds * 1e6), period):
        heading.plan(now, facing(bearing), TARGETS)
        seen.append(heading.at(now))
    return seen


def wrapped(angle):
    return math.remainder(angle, math.tau)


@QUICK
@given(start=ANGLES, bearing=ANGLES)
def test_it_reaches_the_bearing_the_short_way_within_its_limits(start, bearing):
    seen = turned(made(start), bearing, 6.0, 50_000)
    turn = wrapped(bearing - start)
    assert wrapped(seen[-1].yaw - bearing) == pytest.approx(0.0, abs=0.01)
    assert seen[-1].rate == pytest.approx(0.0, abs=0.01)
    if abs(turn) < math.pi - 1e-3:
        yaws = np.array([yaw.yaw for yaw in seen])
        assert yaws[-1] - start == pytest.approx(turn, abs=0.01)
        # Never the other way round, and hardly beyond.
        way = (yaws - start) * np.sign(turn)
        assert way.min() > -0.01
        assert way.max() < 1.1 * abs(turn) + 0.01
    assert max(abs(yaw.acceleration) for yaw in seen) <= CONFIG.acceleration_max + 1e-6
    assert max(abs(yaw.rate) for yaw in seen) <= CONFIG.rate_max + 1e-6


@pytest.mark.parametrize(("start", "bearing"), [(3.0, -3.0), (-3.0, 3.0)])
def test_it_turns_across_the_seam(start, bearing):
    seen = turned(made(start), bearing, 4.0)
    assert seen[-1].yaw == pytest.approx(start + wrapped(bearing - start), abs=0.01)
    assert max(abs(yaw.yaw - start) for yaw in seen) < 0.4


@QUICK
@given(
    seed=st.integers(0, 2**32 - 1),
    rate_max=numbers(0.3, 3.0),
    acceleration_max=numbers(0.5, 5.0),
    wild=st.sampled_from([0.05, 0.5]),
)
def test_limits_and_continuity_hold_on_any_path(seed, rate_max, acceleration_max, wild):
    """A path that jumps as no vehicle can: the yaw stays smooth whenever it is planned anew."""
    random = np.random.default_rng(seed)
    config = HeadingConfig(rate_max=rate_max, acceleration_max=acceleration_max)
    heading = made(1.0, config)
    now = START
    for _ in range(20):
        path = np.cumsum(random.normal(size=(N, 3)), axis=0) * wild
        before = heading.at(now)
        heading.plan(now, path, TARGETS)
        after = heading.at(now)
        assert after.yaw == pytest.approx(before.yaw, abs=1e-9)
        assert after.rate == pytest.approx(before.rate, abs=1e-9)
        times = now + np.arange(0, N * DT, 7_000)
        planned = [heading.at(int(time)) for time in times]
        assert max(abs(yaw.rate) for yaw in planned) <= rate_max + 1e-6
        assert max(abs(yaw.acceleration) for yaw in planned) <= acceleration_max + 1e-6
        steps = np.diff([yaw.yaw for yaw in planned])
        assert np.abs(steps).max() <= rate_max * 7e-3 + 1e-6
        now += int(random.integers(1, 30)) * 4_000


def test_an_orbit_adds_up_its_turns():
    """Unwrapped: three times round, without a jump, and as far behind as an orbit at 0.5 rad/s leaves it."""
    rate, heading = 0.5, made(math.pi)
    ahead = np.arange(1, N + 1) * DT * 1e-6
    yaw = math.pi
    seconds = 3 * math.tau / rate
    for now in range(0, round(seconds * 1e6), 20_000):
        angle = rate * (now * 1e-6 + ahead)
        path = np.column_stack([4 * np.cos(angle), 4 * np.sin(angle), np.full(N, 5.0)])
        heading.plan(START + now, path, TARGETS)
        step = heading.at(START + now).yaw - yaw
        yaw += step
        assert abs(step) < CONFIG.rate_max * 0.02 + 1e-9
    assert yaw == pytest.approx(math.pi + 3 * math.tau, abs=0.02)


@LAWS
@given(start=numbers(-10.0, 10.0), turn=ANGLES)
def test_whole_turns_of_the_start_change_nothing(start, turn):
    plans = []
    for extra in (0.0, math.tau, -2 * math.tau):
        heading = made(start + extra)
        heading.plan(START, facing(start + turn * 0.99), TARGETS)
        plans.append([heading.at(START + k * DT).yaw - extra for k in range(N)])
    np.testing.assert_allclose(plans[1], plans[0], atol=1e-5)
    np.testing.assert_allclose(plans[2], plans[0], atol=1e-5)


@LAWS
@given(start=ANGLES, turn=numbers(-3.0, 3.0))
def test_a_mirrored_scene_mirrors_the_turn(start, turn):
    heading, mirror = made(start), made(-start)
    heading.plan(START, facing(start + turn), TARGETS)
    mirror.plan(START, facing(-start - turn), TARGETS)
    for k in range(N):
        assert mirror.at(START + k * DT).yaw == pytest.approx(-heading.at(START + k * DT).yaw, abs=1e-5)


def test_straight_above_the_target_it_keeps_its_yaw():
    heading = made(0.7)
    for now in range(START, START + 500_000, PERIOD):
        heading.plan(now, np.tile([0.01, -0.02, 5.0], (N, 1)), TARGETS)
        assert heading.at(now).yaw == pytest.approx(0.7, abs=1e-6)


def test_after_its_horizon_it_stands():
    heading = made(0.0)
    heading.plan(START, facing(2.0), TARGETS)
    end = heading.at(START + N * DT)
    assert end == heading.at(START + 100 * N * DT)
    assert (end.rate, end.acceleration) == (0.0, 0.0)
    assert end.yaw == pytest.approx(heading.at(START + N * DT - 1).yaw, abs=1e-5)


def test_a_reset_stands_at_the_measured_yaw():
    heading = made(0.0)
    heading.plan(START, facing(2.0), TARGETS)
    heading.reset(-1.25)
    assert heading.at(START + 500_000) == (-1.25, 0.0, 0.0)
