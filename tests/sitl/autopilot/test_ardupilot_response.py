"""Laws of ArduPilot's position controller: limits of jerk and of corrections, height by throttle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.autopilot.position_control.airframe import ARDUPILOT, GRAVITY, HOVER_THROTTLE, Motion
from sitl.autopilot.position_control.ardupilot_height import HeightControl
from sitl.config.gains import ArduPilotGains, Speeds
from tests.sitl.response_rig import DT, HOVER, circle, led, made, motion, reversing, step, wanted


def streams() -> st.SearchStrategy[list[tuple[Any, Any, Any]]]:
    pairs = st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(-5.0, 5.0))
    speeds = st.tuples(*[st.floats(-5.0, 5.0)] * 3)
    return st.lists(st.tuples(pairs, speeds, speeds), min_size=1, max_size=8)


@given(streams(), st.floats(1.0, 20.0), st.floats(0.5, 5.0))
@settings(max_examples=30)
def test_the_desired_jerk_never_exceeds_its_limit(
    targets: list[tuple[Any, Any, Any]], jerk: float, acceleration: float
) -> None:
    """However the set-points jump; horizontally, in norm."""
    response = made("ardupilot", ardupilot={"jerk": jerk, "acceleration": acceleration})
    response.restart(HOVER)
    before = np.zeros(2)
    for target in targets:
        for _ in range(60):
            response.advance(target, DT)
            now = np.array(response.desired[2][:2])
            assert np.linalg.norm(now - before) <= jerk * DT * (1.0 + 1e-9)
            before = now


def test_a_stream_with_less_jerk_passes_unchanged() -> None:
    _, desired = led(made("ardupilot"), circle, 20.0)
    off = np.abs(desired - wanted(circle, 20.0))[1000:]
    assert off[:, 0].max() < 0.005
    assert off[:, 1].max() < 0.005
    # The acceleration of the step before.
    assert off[:, 2].max() < 0.015


def test_a_stream_with_more_jerk_is_left_the_further_the_less_is_allowed() -> None:
    """A reversal is followed late: what brought real vehicles together."""
    asked = wanted(reversing, 15.0)[:, 0, 0].max()
    overshoots, turned = [], []
    for jerk in (20.0, 5.0, 2.0):
        flown, desired = led(made("ardupilot", ardupilot={"jerk": jerk}), reversing, 15.0)
        overshoots.append(float(flown[:, 0, 0].max() - asked))
        turned.append(DT * int(np.argmax(flown[:, 1, 0] < 0.0)))
        braking = DT * (1.0 + float(np.argmax(desired[1000:, 2, 0] < -1.5)))
        assert braking > 0.9 * 1.5 / jerk
    quick, stock, slow = overshoots
    assert 0.0 < quick < 0.4
    assert quick + 0.5 < stock
    assert stock + 1.0 < slow
    assert turned == sorted(turned)


def test_a_step_is_chased_within_the_limits_of_corrections() -> None:
    flown, desired = led(made("ardupilot", waypoint_speed=1.0), step(2.0), 20.0)
    assert np.linalg.norm(desired[:, 1, :2], axis=1).max() <= 1.0 + 0.05
    assert np.linalg.norm(desired[:, 2, :2], axis=1).max() <= 2.5 + 1e-9
    assert desired[:, 0, 0].max() < 2.0 + 0.1
    assert np.abs(flown[-1, 0] - (2.0, 0.0, -5.0)).max() < 1e-3
    # Not a line is left before 1.8 m at 1 m/s could have been flown.
    assert DT * int(np.argmax(flown[:, 0, 0] > 1.8)) > 1.8


@pytest.mark.parametrize(("up", "down"), [(0.5, 0.4), (2.5, 1.5)])
def test_steps_in_height_keep_to_their_speeds(up: float, down: float) -> None:
    for metres, most in ((-10.0, up), (10.0, down)):
        response = made("ardupilot", waypoint_climb=up, waypoint_sink=down)
        flown, desired = led(
            response, lambda t, by=metres: motion((0.0, 0.0, -20.0 + (by if t else 0.0))), 40.0
        )
        assert np.abs(desired[:, 1, 2]).max() <= most * 1.02
        assert flown[-1, 0, 2] == pytest.approx(-20.0 + metres, abs=0.01)


def test_the_desired_place_waits_for_a_vehicle_that_is_held_back() -> None:
    """In a storm it cannot fly against; it is no further ahead than corrections of WPNAV_SPEED close."""
    response = made("ardupilot", waypoint_speed=2.0)
    flown, desired = led(response, step(50.0), 20.0, wind=(-25.0, 0.0, 0.0))
    gap = np.linalg.norm((desired - flown)[:, 0, :2], axis=1)
    assert gap[1000:].max() <= 2.0 + 0.05 + 1e-6
    assert flown[-1, 0, 0] < 0.0


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_integral_of_the_throttle_learns_nothing_at_its_limit(sign: float) -> None:
    """AC_PID: of a long error at the limit nothing is left, and the throttle leaves it with the error."""
    highest = GRAVITY - ARDUPILOT.full_thrust
    after = []
    for seconds in (1.0, 20.0):
        height = HeightControl(ArduPilotGains(), Speeds())
        for _ in range(round(seconds / DT)):
            down = height.advance((0.0, sign * 50.0, 0.0), (0.0, 0.0, 0.0), DT, highest)
        assert down == pytest.approx(GRAVITY if sign > 0.0 else highest)
        for _ in range(200):
            down = height.advance((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), DT, highest)
        after.append(down)
    assert after[1] == pytest.approx(after[0])
    # An integral that went on would be beyond the limit.
    assert abs(after[1]) < 0.7 * (GRAVITY if sign > 0.0 else -highest)


def climbing(t: float, push: float = 1.0, jerk: float = 3.5) -> Motion:
    """A climb that begins and ends with ``push`` (m/s²) and has no jerk above ``jerk`` (m/s³)."""
    times = np.arange(0.0, t + 1e-9, DT)
    ramp = push / jerk
    phase = times % 4.0
    up = np.clip(np.minimum(phase / ramp, (1.5 - phase) / ramp), 0.0, 1.0)
    down = np.clip(np.minimum((phase - 2.0) / ramp, (3.5 - phase) / ramp), 0.0, 1.0)
    change = push * (up - down) * (times < 4.0)
    speed = np.cumsum(change) * DT
    height = np.cumsum(speed) * DT
    return motion(
        (0.0, 0.0, -5.0 - float(height[-1])), (0.0, 0.0, -float(speed[-1])), (0.0, 0.0, -float(change[-1]))
    )


def test_an_ardupilot_climbs_late() -> None:
    """Three real ArduCopters were 0.04 to 0.12 m off in height on plans with 1 m/s². The throttle's gains
    are the cause: with ten times as much it is less than half."""
    worst = []
    for gains in ({}, {"throttle": 5.0, "throttle_integral": 10.0}):
        flown, _ = led(made("ardupilot", ardupilot=gains), climbing, 8.0)
        off = np.abs(flown[:, 0, 2] - wanted(climbing, 8.0)[:, 0, 2])
        worst.append(float(off.max()))
        assert off[-1] < 0.02
    assert 0.06 < worst[0] < 0.12
    assert worst[1] < 0.5 * worst[0]


def test_the_throttle_gives_a_part_of_an_acceleration_at_once_and_the_rest_by_its_integral() -> None:
    """PSC_ACCZ_P 0.5: the measured acceleration a settles first where a = k (wanted − a), with k = 0.05
    throttle per m/s² times g / hover throttle."""
    k = 0.05 * GRAVITY / HOVER_THROTTLE
    pushes = []
    for integral in (0.0, 1.0):
        gains = {
            "position_z": 1e-6,
            "velocity_z": 1e-6,
            "jerk_z": 1000.0,
            "throttle_integral": integral,
        }
        response = made("ardupilot", ardupilot=gains)
        response.restart(HOVER)
        for n in range(300):
            t = (n + 1) * DT
            response.advance(motion((0.0, 0.0, -5.0 + 0.5 * t * t), (0.0, 0.0, t), (0.0, 0.0, 1.0)), DT)
        pushes.append(response.motion[2][2])
    assert pushes[0] == pytest.approx(k / (1.0 + k), abs=0.02)
    assert pushes[1] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("metres", [-500.0, 500.0])
@pytest.mark.parametrize("gains", [{}, {"throttle": 1000.0, "throttle_integral": 1000.0}])
def test_no_gain_of_the_throttle_gives_more_than_full_thrust_or_less_than_none(
    gains: dict[str, float], metres: float
) -> None:
    response = made("ardupilot", ardupilot={"jerk_z": 100.0, "velocity_z": 50.0, **gains})
    response.restart(HOVER)
    for _ in range(1000):
        response.advance(motion((0.0, 0.0, metres), (0.0, 0.0, metres), (0.0, 0.0, metres)), DT)
        assert GRAVITY - GRAVITY / HOVER_THROTTLE - 1e-9 <= response.motion[2][2] <= GRAVITY + 1e-9
    assert np.isfinite(response.motion).all()
