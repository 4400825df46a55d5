"""How closely the vehicle follows, and what saturation gives up first."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.airframe import airframe, airframe_record
from sitl.allocation import allocate, effectiveness
from sitl.body import body_axes
from sitl.compiled import kernel
from sitl.config import VehicleConfig
from sitl.vehicle import Reference, Vehicle

CONFIG = Path(__file__).parents[2] / "config" / "vehicles" / "firefly.yaml"
FIREFLY = VehicleConfig.model_validate(yaml.safe_load(CONFIG.read_text()))
NUMBERS = airframe(FIREFLY)
RECORD = airframe_record(NUMBERS)
MATRIX = effectiveness(NUMBERS.rotor_x, NUMBERS.rotor_y, NUMBERS.rotor_spin, NUMBERS.k_m)


def circle(t, speed=5.0, radius=8.0):
    """Position, velocity and acceleration on a level circle, as a companion sends them."""
    w = speed / radius
    out, along = np.array([np.cos(w * t), np.sin(w * t), 0.0]), np.array([-np.sin(w * t), np.cos(w * t), 0.0])
    return Reference(radius * out + [0.0, 0.0, -5.0], speed * along, -speed * w * out)


def laps(config, with_jerk, wind=(0.0, 0.0, 0.0)):
    """Position errors (m) and yaws (rad) of 12 s on the circle, set-points at 50 Hz, once it is on it."""
    vehicle = Vehicle(config, circle(0.0).position)
    previous, errors, yaws = circle(0.0), [], []
    for i in range(1250):
        reference = circle(0.02 * i)
        if with_jerk:
            reference = reference.following(previous, 20_000)
        track = vehicle.advance(8, reference, wind)
        previous = reference
        if i >= 650:
            truth = [circle(0.02 * i + 0.0025 * (k + 1)).position for k in range(8)]
            errors.extend(np.linalg.norm(track - truth, axis=1))
            yaws.append(vehicle.yaw)
    return np.array(errors), np.array(yaws)


def test_circle_is_tracked_within_a_decimetre():
    errors, yaws = laps(FIREFLY, with_jerk=True)
    assert np.percentile(errors, 95) < 0.02
    assert np.degrees(np.percentile(np.abs(yaws), 95)) < 1.5


def test_jerk_and_drag_feed_forward_are_what_makes_it_so():
    full, _ = laps(FIREFLY, with_jerk=True)
    without_jerk, _ = laps(FIREFLY, with_jerk=False)
    undragged = FIREFLY.model_copy(update={"drag_feed_forward": 0.0})
    without_drag, _ = laps(undragged, with_jerk=True)
    assert np.percentile(without_jerk, 95) > 4.0 * np.percentile(full, 95)
    assert np.percentile(without_jerk, 95) < 0.15
    assert np.percentile(without_drag, 95) > 10.0 * np.percentile(full, 95)


@given(
    offset=st.tuples(*[st.floats(-30.0, 30.0)] * 3),
    yaw=st.floats(-3.0, 3.0),
    wind=st.tuples(*[st.floats(-5.0, 5.0)] * 2),
)
@settings(max_examples=25, deadline=None)
def test_far_goals_are_reached_without_leaning_too_far(offset, yaw, wind):
    goal = Reference.hover(np.array(offset) - [0.0, 0.0, 200.0], yaw=yaw)
    vehicle = Vehicle(FIREFLY, (0.0, 0.0, -200.0))
    tilts = []
    for _ in range(200):
        vehicle.advance(40, goal, (*wind, 0.0))
        tilts.append(np.degrees(np.arccos(body_axes(tuple(vehicle.state.attitude))[2][2])))
    assert max(tilts) < FIREFLY.max_tilt_deg + 12.0
    # Drag over k_x: the law has no integral, so that steady wind leaves this offset.
    adrift = NUMBERS.cancelled_drag * np.hypot(*wind) / FIREFLY.k_x
    assert np.linalg.norm(vehicle.state.position - goal.position) < 0.02 + 1.2 * adrift
    assert abs(np.remainder(vehicle.yaw - yaw + np.pi, 2 * np.pi) - np.pi) < 0.05


def test_jerk_is_read_from_accelerations_and_never_jolts():
    rest = Reference.hover((0.0, 0.0, 0.0))
    reference = rest
    for i in range(100):
        reference = Reference(np.zeros(3), acceleration=np.array([0.02 * 3.0 * i, 0.0, 0.0])).following(
            reference, 20_000
        )
    np.testing.assert_allclose(reference.jerk, [3.0, 0.0, 0.0], atol=1e-6)
    for elapsed in (1, 20_000, 1_000_000):
        jump = Reference(np.zeros(3), acceleration=np.array([1.0, 0.0, 0.0])).following(rest, elapsed)
        assert 0.0 < jump.jerk[0] <= 10.0
    np.testing.assert_array_equal(rest.following(reference, 0).jerk, reference.jerk)


def test_constant_yaw_rate_is_followed_while_flying():
    vehicle = Vehicle(FIREFLY, (0.0, 0.0, -5.0))
    for i in range(1000):
        vehicle.advance(
            8, Reference(np.array([0.04 * i, 0.0, -5.0]), np.array([2.0, 0, 0]), yaw=0.01 * i, yaw_rate=0.5)
        )
    assert abs(np.remainder(vehicle.yaw - 10.0 + np.pi, 2 * np.pi) - np.pi) < 0.01
    assert np.linalg.norm(vehicle.state.position - [40.0, 0.0, -5.0]) < 0.05


@kernel
def allocated(thrust, moment, airframes):
    speeds = np.empty(airframes[0].rotor_x.size)
    allocate(thrust, moment, airframes[0], speeds)
    return speeds


def wrench_of(thrust, moment):
    speeds = allocated(thrust, moment, RECORD)
    assert np.all(speeds >= FIREFLY.omega_idle * (1 - 1e-12))
    assert np.all(speeds <= FIREFLY.omega_max * (1 + 1e-12))
    return MATRIX @ (FIREFLY.k_f * speeds**2)


@given(st.floats(8.0, 25.0), *[st.floats(-0.3, 0.3)] * 2, st.floats(-0.04, 0.04))
@settings(max_examples=100, deadline=None)
def test_a_feasible_wrench_is_met(thrust, roll, pitch, yaw):
    np.testing.assert_allclose(wrench_of(thrust, (roll, pitch, yaw)), [thrust, roll, pitch, yaw], atol=1e-9)


@given(st.floats(-50.0, 100.0), *[st.floats(-5.0, 5.0)] * 3)
@settings(max_examples=300, deadline=None)
def test_saturation_gives_up_yaw_then_thrust_then_roll_and_pitch(thrust, roll, pitch, yaw):
    got = wrench_of(thrust, (roll, pitch, yaw))
    tilting = np.hypot(roll, pitch)
    kept = got[1:3] @ [roll, pitch] / tilting**2 if tilting > 1e-6 else 1.0
    np.testing.assert_allclose(got[1:3], kept * np.array([roll, pitch]), atol=1e-8)
    assert kept <= 1.0 + 1e-9
    assert got[3] * yaw >= -1e-9
    assert abs(got[3]) <= abs(yaw) + 1e-9
    plain = wrench_of(thrust, (roll, pitch, 0.0))
    np.testing.assert_allclose(got[:3], plain[:3], atol=1e-8)  # yaw costs nothing else
    if kept < 1.0 - 1e-9:
        speeds = allocated(thrust, (roll, pitch, 0.0), RECORD)
        assert speeds.max() == pytest.approx(FIREFLY.omega_max)
        assert speeds.min() == pytest.approx(FIREFLY.omega_idle)
    elif abs(got[0] - thrust) > 1e-6:
        speeds = allocated(thrust, (roll, pitch, 0.0), RECORD)
        limit = speeds.max() if thrust > got[0] else speeds.min()
        assert limit == pytest.approx(FIREFLY.omega_max if thrust > got[0] else FIREFLY.omega_idle)
