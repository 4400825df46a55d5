"""Laws of the position controllers of both firmwares on their airframes: where they rest, what they follow,
what they learn."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.autopilot.firmware import Mode
from sitl.autopilot.guidance import Guidance
from sitl.autopilot.position_control.airframe import ARDUPILOT, GRAVITY, PX4, Airframe, Motion, PointMass
from sitl.values.setpoints import POSITION, Pose, Setpoint
from tests.sitl.autopilot_rig import FLAVOURS, ZERO, Rig
from tests.sitl.response_rig import DT, HOVER, circle, config, led, made, motion, reversing, step

VECTORS = st.tuples(*[st.floats(-10.0, 10.0)] * 3)
FIRMWARE = pytest.mark.parametrize("flavour", FLAVOURS)


def still(t: float) -> Motion:
    return motion(HOVER)


# Where it rests


@FIRMWARE
@given(place=VECTORS, dt=st.sampled_from((0.002, 0.005, 0.01)))
@settings(max_examples=20)
def test_at_rest_it_stays(flavour: str, place: tuple[float, float, float], dt: float) -> None:
    response = made(flavour)
    response.restart(place)
    for _ in range(300):
        response.advance(motion(place), dt)
    assert response.motion == (place, ZERO, ZERO)
    assert response.desired[0] == place


@FIRMWARE
@settings(max_examples=20)
@given(VECTORS, VECTORS)
def test_it_comes_to_rest_where_it_is_told_to(flavour: str, begin: tuple, goal: tuple) -> None:
    response = made(flavour)
    response.restart(begin)
    for _ in range(4000):
        response.advance(motion(goal), DT)
    position, velocity, acceleration = map(np.array, response.motion)
    assert np.abs(position - goal).max() < 0.01
    assert np.abs(velocity).max() < 0.01
    assert np.abs(acceleration).max() < 0.02


# What it follows


@FIRMWARE
def test_a_constant_velocity_is_followed_without_error_in_the_end(flavour: str) -> None:
    """The integral learns the drag, which at first holds it back. A PX4 that descends has less thrust than in
    a hover; its estimate of the hover thrust learns that within minutes."""
    velocity = np.array((3.0, -2.0, 0.5))
    flown, _ = led(made(flavour), lambda t: motion(velocity * t, velocity), 240.0)
    times = DT * (1.0 + np.arange(len(flown)))
    errors = np.linalg.norm(flown[:, 0] - np.outer(times, velocity), axis=1)
    assert errors[100] > 0.1
    assert errors[-1] < 1e-5
    np.testing.assert_allclose(flown[-1, 1], velocity, atol=1e-5)


@FIRMWARE
def test_wind_is_learnt(flavour: str) -> None:
    flown, _ = led(made(flavour), still, 60.0, wind=(4.0, -1.0, 0.0))
    errors = np.linalg.norm(flown[:, 0] - HOVER, axis=1)
    assert errors.max() > 0.3
    assert errors[-1] < 1e-5


@FIRMWARE
def test_what_is_learnt_is_forgotten_by_a_restart(flavour: str) -> None:
    response = made(flavour)
    led(response, still, 30.0, wind=(6.0, 0.0, 0.0))
    again, _ = led(response, circle, 5.0)
    fresh, _ = led(made(flavour), circle, 5.0)
    np.testing.assert_array_equal(again, fresh)


@FIRMWARE
def test_it_is_the_same_everywhere(flavour: str) -> None:
    away = np.array((100.0, -50.0, 7.0))

    def elsewhere(t: float) -> Motion:
        position, velocity, acceleration = circle(t)
        return motion(np.array(position) + away, velocity, acceleration)

    there, _ = led(made(flavour), elsewhere, 10.0)
    here, _ = led(made(flavour), circle, 10.0)
    np.testing.assert_allclose(there[:, 0], here[:, 0] + away, atol=1e-9)
    np.testing.assert_allclose(there[:, 1:], here[:, 1:], atol=1e-9)


TURNS = {
    "a quarter": (((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), 1e-9),
    "mirrored": (((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)), 1e-9),
    # Tilt and drag act by axes, so between the axes it is the same but for a few centimetres.
    "between the axes": (((0.6, 0.8, 0.0), (-0.8, 0.6, 0.0), (0.0, 0.0, 1.0)), 0.06),
}


@FIRMWARE
@pytest.mark.parametrize("turn", TURNS)
def test_it_is_the_same_in_every_direction(flavour: str, turn: str) -> None:
    rows, tolerance = TURNS[turn]
    matrix = np.array(rows)
    there, _ = led(made(flavour), lambda t: motion(*(matrix @ part for part in circle(t))), 10.0)
    here, _ = led(made(flavour), circle, 10.0)
    np.testing.assert_allclose(there[:, 0], here[:, 0] @ matrix.T, atol=tolerance)


@FIRMWARE
def test_the_length_of_steps_hardly_matters(flavour: str) -> None:
    coarse, _ = led(made(flavour), circle, 10.0)
    fine, _ = led(made(flavour), circle, 10.0, dt=DT / 4.0)
    assert np.abs(coarse[:, 0] - fine[3::4, 0]).max() < 0.03


@FIRMWARE
@given(VECTORS, VECTORS)
@settings(max_examples=20)
def test_an_estimate_that_jumps_takes_it_along_with_its_errors(
    flavour: str, place: tuple[float, float, float], velocity: tuple[float, float, float]
) -> None:
    """With set-points that jump as far, all goes on as if nothing had jumped."""
    jumped, other = made(flavour), made(flavour)
    led(jumped, circle, 3.0)
    led(other, circle, 3.0)
    shift = np.array(place) - other.motion[0]
    jumped.relocate(place, other.motion[1])
    assert jumped.motion[0] == place
    for k in range(200):
        position, speed, push = circle(3.0 + (k + 1) * DT)
        other.advance((position, speed, push), DT)
        jumped.advance(motion(np.array(position) + shift, speed, push), DT)
    for mine, theirs in ((jumped.motion, other.motion), (jumped.desired, other.desired)):
        np.testing.assert_allclose(mine[0], np.array(theirs[0]) + shift, atol=1e-9)
        np.testing.assert_allclose(mine[1:], theirs[1:], atol=1e-9)
    jumped.relocate(place, velocity)
    assert jumped.motion[:2] == (place, velocity)


# Height and thrust


@pytest.mark.parametrize("airframe", [ARDUPILOT, PX4], ids=["ardupilot", "px4"])
@given(
    st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0), st.floats(-5.0, 15.0)),
)
@settings(max_examples=40)
def test_the_same_tilt_pushes_less_the_less_thrust_there_is(
    airframe: Airframe, wanted: tuple[float, float, float]
) -> None:
    """Thrust is along the body's axis: a(level) / (g − a(down)) = tan(tilt), and rotors never push downwards.
    Both firmwares choose the tilt as in hover."""
    mass = PointMass(airframe._replace(drag=0.0, square_drag=0.0))
    mass.restart(HOVER)
    for _ in range(400):
        mass.advance(wanted, ZERO, DT)
    lift = max(GRAVITY - wanted[2], 0.0) / GRAVITY
    expected = (wanted[0] * lift, wanted[1] * lift, wanted[2])
    np.testing.assert_allclose(mass.acceleration, expected, atol=1e-3)


@pytest.mark.parametrize("airframe", [ARDUPILOT, PX4], ids=["ardupilot", "px4"])
@given(st.tuples(st.floats(-25.0, 25.0), st.floats(-25.0, 25.0), st.floats(-30.0, 9.0)))
@settings(max_examples=40)
def test_thrust_is_full_thrust_at_most_at_any_tilt(
    airframe: Airframe, wanted: tuple[float, float, float]
) -> None:
    mass = PointMass(airframe._replace(drag=0.0, square_drag=0.0, vertical_drag=False))
    mass.restart(HOVER)
    for _ in range(400):
        mass.advance(wanted, ZERO, DT)
        north, east, down = mass.acceleration
        assert math.hypot(north, east, GRAVITY - down) <= airframe.full_thrust + 1e-9
    # And all of it is there for one that asks for more upwards.
    if GRAVITY - wanted[2] > airframe.full_thrust:
        assert math.hypot(north, east, GRAVITY - down) == pytest.approx(airframe.full_thrust)


# Tilt


@pytest.mark.parametrize(
    ("flavour", "gains", "drag"),
    [
        ("ardupilot", {"ardupilot": {"tilt": math.radians(15.0), "acceleration": 10.0, "jerk": 50.0}}, 0.246),
        ("px4", {"px4": {"tilt": math.radians(15.0)}}, 1.0),
    ],
)
def test_it_tilts_as_far_as_it_may_and_no_further(flavour: str, gains: dict[str, Any], drag: float) -> None:
    """Told by acceleration and drag, which nothing but tilt can balance."""
    flown, _ = led(made(flavour, **gains), step(30.0), 20.0)
    speed = flown[:, 1, 0]
    square = 0.0336 if flavour == "ardupilot" else 0.0
    push = flown[:, 2, 0] + drag * speed + square * np.abs(speed) * speed
    tilt = np.degrees(np.arctan(np.abs(push) / GRAVITY))
    assert 14.5 < tilt.max() < 15.2


NUMBERS = st.floats(-1e5, 1e5)
FAST = st.floats(-1e3, 1e3)


@FIRMWARE
@given(
    st.lists(
        st.tuples(st.tuples(*[NUMBERS] * 3), st.tuples(*[FAST] * 3), st.tuples(*[FAST] * 3)),
        min_size=1,
        max_size=6,
    ),
    st.tuples(*[st.floats(-30.0, 30.0)] * 3),
    st.sampled_from((0.0025, 0.005, 0.01)),
)
@settings(max_examples=30)
def test_no_set_point_that_is_accepted_makes_a_number_that_is_none(
    flavour: str, targets: list[Motion], wind: tuple[float, float, float], dt: float
) -> None:
    response = made(flavour)
    response.restart(HOVER)
    for target in targets:
        for _ in range(40):
            response.advance(target, dt, wind)
        assert np.isfinite((response.motion, response.desired)).all()
        response.relocate(*target[:2])
    response.advance(motion(HOVER), dt, wind)
    assert np.isfinite((response.motion, response.desired)).all()


@FIRMWARE
def test_the_same_set_points_give_the_same_flight(flavour: str) -> None:
    first, second = (led(made(flavour), reversing, 14.0)[0] for _ in range(2))
    np.testing.assert_array_equal(first, second)


# In the autopilot


@pytest.mark.parametrize(("flavour", "carried"), [("ardupilot", True), ("px4", False)])
def test_between_two_messages_ardupilot_carries_a_set_point_on_and_px4_holds_it(
    flavour: str, carried: bool
) -> None:
    guidance = Guidance(config(flavour))
    guidance.hover(Pose(HOVER, 0.0))
    sent = Setpoint(
        (POSITION, POSITION, POSITION), HOVER, (2.0, -1.0, 0.5), (0.5, 0.0, 0.0), yaw=0.0, complete=True
    )
    guidance.track(sent, 0, 3_000_000, Pose(HOVER, 0.0), 0)
    for k in range(20):
        guidance.advance(k * 10_000, 10_000)
        t = (k + 1) * 0.01 if carried else 0.0
        position, velocity, acceleration = guidance.commanded
        np.testing.assert_allclose(position, (2.0 * t + 0.25 * t * t, -t, -5.0 + 0.5 * t), atol=1e-9)
        np.testing.assert_allclose(velocity, (2.0 + 0.5 * t, -1.0, 0.5), atol=1e-9)
        assert acceleration == (0.5, 0.0, 0.0)


@FIRMWARE
def test_a_vehicle_with_it_takes_off_and_lands(flavour: str) -> None:
    rig = Rig(flavour, response="firmware").hover(5.0)
    assert -rig.autopilot.estimate.pose.position[2] == pytest.approx(5.0, abs=0.15)
    assert rig.autopilot.mode is (Mode.GUIDED if flavour == "ardupilot" else Mode.HOLD)
    assert rig.order(21) == [0]
    rig.run(15.0)
    assert not rig.autopilot.armed
    assert not rig.autopilot.airborne
