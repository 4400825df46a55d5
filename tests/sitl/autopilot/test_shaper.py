"""Laws of the references: bounded, continuous, arriving without overshoot, transparent to what can fly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.autopilot.shaper import Heading, Limits, Shaper
from sitl.values.setpoints import ACCELERATION, POSITION, VELOCITY, ZERO, Setpoint

DT = 0.005
LIMITS = Limits(speed=5.0, acceleration=4.0, jerk=40.0)
PPP, VVV, AAA = (POSITION,) * 3, (VELOCITY,) * 3, (ACCELERATION,) * 3

PLACES = st.tuples(*[st.floats(-30, 30)] * 3)
SPEEDS = st.tuples(*[st.floats(-2.5, 2.5)] * 3)


def flown(shaper, wanted, seconds, limits=LIMITS):
    """Position, velocity, acceleration (n, 3, 3) after each step; ``wanted`` may be a function of time."""
    rows = []
    for k in range(1, round(seconds / DT) + 1):
        shaper.advance(wanted(k * DT) if callable(wanted) else wanted, limits, DT)
        rows.append((shaper.position, shaper.velocity, shaper.acceleration))
    return np.array(rows)


def moving(velocity):
    shaper = Shaper()
    flown(shaper, Setpoint(VVV, velocity=velocity), 3.0)
    return shaper


def assert_flyable(rows, limits=LIMITS):
    p, v, a = rows[:, 0], rows[:, 1], rows[:, 2]
    assert np.linalg.norm(v, axis=1).max() <= limits.speed + 0.1
    assert np.linalg.norm(a, axis=1).max() <= limits.acceleration + 1e-9
    assert np.linalg.norm(np.diff(a, axis=0), axis=1).max() <= limits.jerk * DT + 1e-9
    np.testing.assert_allclose(np.diff(v, axis=0), DT * a[1:], atol=1e-9)
    np.testing.assert_allclose(np.diff(p, axis=0), DT * v[:-1] + DT * DT / 2 * a[1:], atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(place=PLACES, velocity=SPEEDS)
def test_it_reaches_any_place_from_any_motion_within_the_limits(place, velocity):
    shaper = moving(velocity)
    start = np.array(shaper.position)
    rows = flown(shaper, Setpoint(PPP, tuple(start + place)), 20.0)
    assert_flyable(rows)
    assert np.linalg.norm(rows[-1, 0] - start - place) < 0.01
    assert np.linalg.norm(rows[-1, 1]) < 0.01


@pytest.mark.parametrize("distance", [0.1, 1.0, 5.0, 40.0])
def test_from_rest_it_does_not_overshoot(distance):
    rows = flown(Shaper(), Setpoint(PPP, (distance, 0.0, 0.0)), 20.0)
    assert_flyable(rows)
    assert rows[:, 0, 0].max() < distance + 0.01
    assert rows[-1, 0, 0] == pytest.approx(distance, abs=1e-3)


def test_a_new_place_never_makes_the_reference_jump():
    shaper = Shaper()
    rows = flown(shaper, lambda t: Setpoint(PPP, ((10.0, 0.0, 0.0), (-3.0, 8.0, 1.0))[int(t / 0.7) % 2]), 6.0)
    assert_flyable(rows)


@settings(max_examples=20, deadline=None)
@given(before=SPEEDS, after=SPEEDS)
def test_velocities_are_reached_within_the_limits(before, after):
    rows = flown(moving(before), Setpoint(VVV, velocity=after), 5.0)
    assert_flyable(rows)
    np.testing.assert_allclose(rows[-1, 1], after, atol=1e-3)


def test_an_acceleration_ends_at_the_speed_limit():
    rows = flown(Shaper(), Setpoint(AAA, acceleration=(2.0, 0.0, 0.0)), 1.5)
    assert_flyable(rows)
    assert rows[-1, 1, 0] == pytest.approx(3.0, abs=0.1)
    rows = flown(Shaper(), Setpoint(AAA, acceleration=(2.0, 0.0, 0.0)), 10.0)
    assert LIMITS.speed <= rows[-1, 1, 0] < LIMITS.speed + 2.0 / 3.0


def test_axes_are_controlled_each_by_its_own_quantity():
    wanted = Setpoint((VELOCITY, VELOCITY, POSITION), (0.0, 0.0, -3.0), (1.0, 0.5, 0.0))
    rows = flown(Shaper(), wanted, 8.0)
    assert_flyable(rows)
    np.testing.assert_allclose(rows[-1, 1], (1.0, 0.5, 0.0), atol=1e-3)
    assert rows[-1, 0, 2] == pytest.approx(-3.0, abs=1e-3)


def circle(t, radius=3.0, rate=0.8):
    c, s = math.cos(rate * t), math.sin(rate * t)
    return Setpoint(
        PPP,
        (radius * c, radius * s, 0.0),
        (-radius * rate * s, radius * rate * c, 0.0),
        (-radius * rate**2 * c, -radius * rate**2 * s, 0.0),
        complete=True,
    )


def test_a_trajectory_is_joined_and_then_passed_through_unchanged():
    shaper = Shaper((0.0, 0.0, 4.0))
    joining = flown(shaper, circle, 8.0)
    first = np.argmax(
        np.all(joining[:, 0] == [circle((k + 1) * DT).position for k in range(len(joining))], axis=1)
    )
    assert first > 0
    assert_flyable(joining[:first])
    assert np.linalg.norm(joining[first, 0] - joining[first - 1, 0]) < 0.08
    rows = flown(shaper, lambda t: circle(8.0 + t), 4.0)
    for k, row in enumerate(rows, 1):
        exact = circle(8.0 + k * DT)
        assert np.array_equal(row, (exact.position, exact.velocity, exact.acceleration))


@pytest.mark.parametrize(("jump", "passed"), [(0.3, True), (0.8, False), (20.0, False)])
def test_a_trajectory_that_jumps_is_chased_not_stepped_to(jump, passed):
    shaper = Shaper()
    shaper.advance(Setpoint(PPP, complete=True), LIMITS, DT)
    assert shaper.captured
    shaper.advance(Setpoint(PPP, (jump, 0.0, 0.0), complete=True), LIMITS, DT)
    assert shaper.position[0] == (jump if passed else pytest.approx(0.0, abs=1e-3))


@settings(max_examples=15, deadline=None)
@given(place=PLACES, velocity=SPEEDS, angle=st.floats(-math.pi, math.pi))
def test_it_knows_no_direction(place, velocity, angle):
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    plain = flown(moving(velocity), Setpoint(PPP, place), 3.0)
    turned = flown(moving(tuple(turn @ velocity)), Setpoint(PPP, tuple(turn @ place)), 3.0)
    np.testing.assert_allclose(plain @ turn.T, turned, atol=1e-6)


def test_no_time_no_motion():
    shaper = moving((1.0, 2.0, 0.0))
    before = shaper.position, shaper.velocity, shaper.acceleration
    shaper.advance(Setpoint(PPP, (50.0, 0.0, 0.0)), LIMITS, 0.0)
    assert (shaper.position, shaper.velocity, shaper.acceleration) == before


def test_rest_is_recognised():
    shaper = moving((1.0, 0.0, 0.0))
    assert not shaper.at_rest
    flown(shaper, Setpoint(VVV), 6.0)
    assert shaper.at_rest
    shaper.restart((1.0, 1.0, 1.0))
    assert (shaper.position, shaper.velocity, shaper.acceleration) == ((1.0, 1.0, 1.0), ZERO, ZERO)


@settings(max_examples=40, deadline=None)
@given(start=st.floats(-math.pi, math.pi), end=st.floats(-10.0, 10.0))
def test_a_heading_turns_the_short_way_within_its_limits(start, end):
    heading = Heading(rate=1.5, acceleration=2.0)
    heading.restart(start)
    turned, last = 0.0, 0.0
    for _ in range(2000):
        heading.advance(end, None, DT)
        assert abs(heading.yaw_rate) <= 1.5 + 1e-9
        assert abs(heading.yaw_rate - last) <= 2.0 * DT + 1e-9
        last = heading.yaw_rate
        turned += heading.yaw_rate * DT
    assert abs(math.remainder(heading.yaw - end, math.tau)) < 1e-3
    assert abs(turned) <= math.pi + 0.05


def test_a_heading_follows_a_turn_without_lag_and_stops_when_told_nothing():
    heading = Heading(rate=1.5, acceleration=2.0)
    heading.restart(0.0)
    for k in range(1, 1001):
        heading.advance(0.8 * k * DT, 0.8, DT)
    assert heading.yaw == pytest.approx(math.remainder(0.8 * 1000 * DT, math.tau), abs=1e-3)
    for _ in range(1000):
        heading.advance(None, 0.5, DT)
    assert heading.yaw_rate == pytest.approx(0.5)
    for _ in range(1000):
        heading.advance(None, None, DT)
    assert heading.yaw_rate == 0.0
