"""Set-points on the globe and as attitudes: the same flight as what they mean in local NED."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.messages import SetpointAttitude, SetpointGlobal
from sitl.autopilot.attitude_setpoints import GRAVITY, STEEPEST, climbing, thrusting
from sitl.autopilot.firmware import Mode
from sitl.values.setpoints import Refusal, Setpoint
from tests.sitl.autopilot_rig import (
    ALL,
    FLAVOURS,
    PILOT,
    POSITION_YAW,
    SITE,
    VELOCITY_YAW,
    ZERO,
    Rig,
    setpoint,
)

ABOVE_SEA, ABOVE_HOME = (0, 5), (3, 6)
NAN = math.nan
ATTITUDE_ONLY = 0x07


def on_globe(north, east, up, *, frame=6, mask=POSITION_YAW, velocity=ZERO, yaw=0.0):
    """A set-point at a place, m from home; ``up`` as the frame counts."""
    latitude, longitude, _ = SITE.to_geodetic((east, north, 0.0))
    place = round(latitude * 1e7), round(longitude * 1e7), up
    return SetpointGlobal(PILOT, 0, 11, 1, frame, mask, *place, velocity, ZERO, yaw, 0.0)


def quaternion(roll, pitch, yaw):
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def attitude(roll=0.0, pitch=0.0, yaw=0.0, thrust=0.5, mask=ATTITUDE_ONLY):
    return SetpointAttitude(PILOT, 0, 11, 1, mask, quaternion(roll, pitch, yaw), ZERO, thrust)


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("frame", [*ABOVE_SEA, *ABOVE_HOME])
def test_a_place_on_the_globe_is_flown_to(flavour, frame):
    rig = Rig(flavour).hover(5.0)
    up = 8.0 + (SITE.altitude if frame in ABOVE_SEA else 0.0)
    rig.steer(12.0, on_globe(6.0, -4.0, up, frame=frame, yaw=1.0))
    # degE7 is 1.1 cm; the altitude is a float32 of some hundred metres.
    assert np.linalg.norm(rig.position - (6.0, -4.0, -8.0)) < 0.03


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_position_and_velocity_on_the_globe_fly_as_in_local_ned(flavour):
    def flight(make):
        rig = Rig(flavour).hover(5.0)
        tracks = []
        for k in range(400):
            t = 0.02 * k
            message = make((0.5 * t, 0.0, -5.0), (0.5, 0.0, 0.0))
            if k == 0:
                rig.steer(0.02, message)
            rig.run(0.02, message)
            tracks.append(rig.position)
        return np.array(tracks)

    local = flight(lambda p, v: setpoint(0x9C0, p, v))
    globe = flight(lambda p, v: on_globe(p[0], p[1], -p[2], mask=0x9C0, velocity=v))
    assert np.abs(local - globe).max() < 0.02


def test_unknown_frames_stop_an_arducopter_and_nothing_else():
    ardupilot, px4 = Rig("ardupilot").hover(5.0), Rig("px4").hover(5.0)
    for rig in (ardupilot, px4):
        rig.steer(2.0, setpoint(VELOCITY_YAW, velocity=(1.0, 0.0, 0.0)))
        rig.received.clear()
        rig.run(0.5, on_globe(50.0, 0.0, 5.0, frame=11), setpoint(VELOCITY_YAW, velocity=(1.0, 0.0, 0.0)))
    assert "Set-point stops: frame 11" in ardupilot.texts
    assert "Set-point refused: frame 11" in px4.texts
    assert px4.speed == pytest.approx(1.0, abs=0.05)
    ardupilot.step(on_globe(50.0, 0.0, 5.0, frame=11))
    ardupilot.run(2.0)
    assert ardupilot.speed < 0.05


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("x", [900_000_001, -(2**31)])
def test_places_that_do_not_exist_are_refused(flavour, x):
    rig = Rig(flavour).hover(5.0)
    rig.steer(1.0, setpoint(ALL, (0.0, 0.0, -5.0)))
    bad = on_globe(0.0, 0.0, 5.0)._replace(x=x)
    nan = on_globe(0.0, 0.0, NAN)
    rig.received.clear()
    rig.run(0.3, bad, nan)
    assert sorted(rig.texts) == [
        "Set-point refused: no such place on the globe",
        "Set-point refused: position not a number",
    ]
    assert rig.speed < 0.02


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_an_attitude_accelerates_where_its_thrust_points(flavour):
    rig = Rig(flavour).hover(5.0)
    tilt = 0.1
    # PX4's thrust is thrust: a little more of it keeps the height.
    thrust = 0.5 if flavour == "ardupilot" else 0.5 / math.cos(tilt)
    rig.steer(2.0, attitude(pitch=-tilt, yaw=math.pi / 2, thrust=thrust))
    north, east, down = rig.autopilot.state.velocity
    assert east == pytest.approx(2.0 * GRAVITY * math.tan(tilt), rel=0.1)
    assert abs(north) < 0.05
    assert abs(down) < 0.05


def test_an_arducopter_climbs_by_thrust_and_stops_when_it_is_told_no_more():
    rig = Rig("ardupilot").hover(5.0)
    rig.steer(3.0, attitude(thrust=1.0))
    assert -rig.autopilot.state.velocity[2] == pytest.approx(rig.config.waypoint_climb, abs=0.05)
    rig.run(rig.config.guided_timeout + 3.0)
    assert rig.speed < 0.05
    assert "Set-points timed out" in rig.texts
    assert rig.autopilot.mode is Mode.GUIDED


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize(
    ("bad", "why"),
    [
        (attitude(mask=0x87), "body rates alone are not flown"),
        (attitude(mask=0x47), "no thrust from 0 to 1"),
        (attitude(thrust=1.2), "no thrust from 0 to 1"),
        (attitude(thrust=NAN), "no thrust from 0 to 1"),
        (attitude()._replace(attitude=(NAN, 0.0, 0.0, 0.0)), "not a unit quaternion"),
        (attitude()._replace(attitude=(0.0, 0.0, 0.0, 0.0)), "not a unit quaternion"),
        (attitude(mask=0x03)._replace(body_rates=(0.0, 0.0, NAN)), "yaw rate out of range"),
    ],
)
def test_a_bad_attitude_is_refused_with_its_reason(flavour, bad, why):
    rig = Rig(flavour).hover(5.0)
    rig.steer(1.0, setpoint(ALL, (0.0, 0.0, -5.0)))
    rig.received.clear()
    rig.run(0.3, bad)
    assert rig.texts == [f"Attitude refused: {why}"]
    assert rig.speed < 0.02


angle = st.floats(-math.pi, math.pi)


@given(roll=st.floats(-1.5, 1.5), pitch=st.floats(-1.5, 1.5), yaw=angle, thrust=st.floats(0.0, 1.0))
@settings(max_examples=200, deadline=None)
def test_attitudes_of_any_tilt_ask_for_what_a_rotor_can_give(roll, pitch, yaw, thrust):
    message = attitude(roll, pitch, yaw, thrust)
    flat, free = climbing(message, 2.5, 1.5), thrusting(message)
    assert isinstance(flat, Setpoint)
    assert isinstance(free, Setpoint)
    assert math.hypot(*flat.acceleration) <= GRAVITY * math.tan(STEEPEST) + 1e-9
    push = math.hypot(free.acceleration[0], free.acceleration[1], free.acceleration[2] - GRAVITY)
    assert push == pytest.approx(2.0 * thrust * GRAVITY, abs=1e-6)
    assert -1.5 <= -flat.velocity[2] <= 2.5


@given(yaw=angle, roll=st.floats(-0.5, 0.5), pitch=st.floats(-0.5, 0.5), turn=angle)
@settings(max_examples=100, deadline=None)
def test_turning_an_attitude_turns_its_acceleration(yaw, roll, pitch, turn):
    here, there = (climbing(attitude(roll, pitch, y), 2.5, 1.5) for y in (yaw, yaw + turn))
    assert not isinstance(here, Refusal)
    assert not isinstance(there, Refusal)
    x, y, _ = here.acceleration
    c, s = math.cos(turn), math.sin(turn)
    assert there.acceleration[:2] == pytest.approx((c * x - s * y, s * x + c * y), abs=1e-9)
    assert math.remainder(there.yaw - here.yaw - turn, math.tau) == pytest.approx(0.0, abs=1e-9)
