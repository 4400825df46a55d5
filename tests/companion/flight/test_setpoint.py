"""What is sent: the horizon in the vehicle's own NED frame, for every compass direction, and finite."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.setpoint import setpoint
from companion.goals.heading import Yaw
from companion.values.horizon import roll_out
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Source
from mavlink_bridge.wire.codec import Codec
from tests.companion.rig import LAWS, ZERO, numbers, vectors

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
HOME = FLEET.local(47.397742, 8.545594, 488.0)
OWN = Source(11, 195)
EPOCH = 1_767_225_600_000_000

LEVEL = Yaw(0.0, 0.0, 0.0)
COMPASS = {
    # ENU direction, its yaw from east; NED direction, its yaw from north.
    "north": ((0.0, 1.0, 0.0), math.pi / 2, (1.0, 0.0, 0.0), 0.0),
    "east": ((1.0, 0.0, 0.0), 0.0, (0.0, 1.0, 0.0), math.pi / 2),
    "south": ((0.0, -1.0, 0.0), -math.pi / 2, (-1.0, 0.0, 0.0), math.pi),
    "west": ((-1.0, 0.0, 0.0), math.pi, (0.0, -1.0, 0.0), -math.pi / 2),
}


def sent(position=ZERO, velocity=ZERO, acceleration=ZERO, yaw=LEVEL):
    horizon = roll_out(EPOCH, 100_000, position, velocity, np.tile(acceleration, (16, 1)))
    return setpoint(EPOCH, 2_000_000, horizon, yaw, HOME, OWN, 0)


@pytest.mark.parametrize("name", COMPASS)
def test_compass_directions(name):
    enu, yaw, ned, yaw_ned = COMPASS[name]
    message = sent(5.0 * np.array(enu), 3.0 * np.array(enu), 2.0 * np.array(enu), Yaw(yaw, 0.0, 0.0))
    for value, scale in ((message.position, 5.0), (message.velocity, 3.0), (message.acceleration, 2.0)):
        np.testing.assert_allclose(value, scale * np.array(ned), atol=1e-6)
    assert math.remainder(message.yaw - yaw_ned, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_up_is_minus_down_and_a_left_turn_is_a_negative_rate():
    up = np.array([0.0, 0.0, 4.0])
    message = sent(up, up, up, Yaw(0.0, 0.7, 0.3))
    for value in (message.position, message.velocity, message.acceleration):
        assert value[2] == pytest.approx(-4.0)
    # ENU counts counter-clockwise, NED clockwise.
    assert message.yaw_rate == -0.7


@LAWS
@given(
    x=vectors(50.0),
    v=vectors(8.0),
    a=vectors(7.0),
    yaw=st.builds(Yaw, numbers(-50.0, 50.0), numbers(-3.0, 3.0), numbers(-3.0, 3.0)),
    place=vectors(200.0),
    lead=st.integers(0, 2_000_000),
)
def test_the_receiver_reads_the_horizon_at_that_time_whatever_its_origin(x, v, a, yaw, place, lead):
    local = FLEET.local(*FLEET.to_geodetic(place))
    horizon = roll_out(EPOCH, 100_000, x, v, np.tile(a, (16, 1)))
    message = setpoint(EPOCH + lead, 2_000_000, horizon, yaw, local, OWN, 0)
    motion = horizon.at(EPOCH + lead)
    np.testing.assert_allclose(local.position_to_fleet(message.position), motion.position, atol=1e-6)
    np.testing.assert_allclose(local.velocity_to_fleet(message.velocity), motion.velocity, atol=1e-9)
    np.testing.assert_allclose(local.velocity_to_fleet(message.acceleration), motion.acceleration, atol=1e-9)
    assert math.remainder(local.yaw_to_fleet(message.yaw) - yaw.yaw, math.tau) == pytest.approx(0, abs=1e-9)
    # The same after the wire, to float32.
    (wired,) = Codec().feed(Codec().encode(message))
    assert np.isfinite(
        [*wired.position, *wired.velocity, *wired.acceleration, wired.yaw, wired.yaw_rate]
    ).all()
    np.testing.assert_allclose(wired.position, message.position, rtol=1e-6, atol=1e-6)
    assert -math.pi - 1e-6 <= wired.yaw <= math.pi + 1e-6


def corrected(v, bias, velocities):
    """The velocity that is sent, in the fleet's frame, of a plan with velocity ``v``."""
    horizon = roll_out(EPOCH, 100_000, ZERO, v, np.zeros((16, 3)))
    message = setpoint(EPOCH, 0, horizon, LEVEL, HOME, OWN, 0, bias=bias, velocities=velocities)
    return np.array(HOME.velocity_to_fleet(message.velocity))


@given(v=vectors(8.0), bias=vectors(4.0))
def test_a_correction_passes_no_limit_and_is_sent_whole_where_it_meets_none(v, bias):
    """On each axis. Where the plan itself is beyond a limit, a correction goes no further beyond it."""
    least, most = velocities = np.array([[-1.0, -3.0, -0.5], [2.0, 1.0, 2.0]])
    found, wanted = corrected(v, bias, velocities), v + bias
    for axis in range(3):
        got, plan = found[axis], v[axis]
        if least[axis] <= wanted[axis] <= most[axis]:
            assert got == pytest.approx(wanted[axis], abs=1e-9)
        elif least[axis] <= plan <= most[axis]:
            limit = least[axis] if wanted[axis] < least[axis] else most[axis]
            assert got == pytest.approx(limit, abs=1e-9)
        else:
            assert got >= min(least[axis], plan) - 1e-9
            assert got <= max(most[axis], plan) + 1e-9


def test_a_planned_climb_does_not_lower_the_bound_of_descent():
    velocities = np.array([[-1.0, -1.0, -0.5], [1.0, 1.0, 2.0]])
    found = corrected(np.array([0.0, 0.0, 0.7]), np.array([0.0, 0.0, -1.5]), velocities)
    assert found[2] == pytest.approx(-0.5, abs=1e-9)


@given(v=vectors(8.0), bias=vectors(4.0))
def test_the_bound_of_one_direction_does_not_depend_on_a_plan_in_the_other(v, bias):
    """With equal limits both ways this differs from a bound on the speed only where |v| exceeds the limit."""
    limits = np.array([3.0, 2.0, 1.0])
    found = corrected(v, bias, np.stack([-limits, limits]))
    most = np.maximum(np.abs(v), limits)
    by_speed = np.clip(v + bias, -most, most)
    within = np.abs(v) <= limits
    np.testing.assert_allclose(found[within], by_speed[within], atol=1e-9)
    # A plan beyond a limit does not move the opposite one.
    assert (found[v > limits] >= -limits[v > limits] - 1e-9).all()
    assert (found[v < -limits] <= limits[v < -limits] + 1e-9).all()


def test_it_is_addressed_to_the_own_autopilot():
    message = sent()
    assert (message.target_system, message.target_component, message.frame) == (11, 1, 1)
    assert message.source == OWN
    assert message.time_boot == 2_000_000


def test_the_acceleration_may_be_that_of_later():
    accelerations = np.arange(48.0).reshape(16, 3)
    horizon = roll_out(EPOCH, 100_000, ZERO, ZERO, accelerations)
    plain = setpoint(EPOCH, 0, horizon, LEVEL, HOME, OWN, 0)
    early = setpoint(EPOCH, 0, horizon, LEVEL, HOME, OWN, 0, lead=200_000)
    east, north, up = accelerations[2]
    np.testing.assert_allclose(early.acceleration, (north, east, -up), atol=1e-6)
    assert early._replace(acceleration=plain.acceleration) == plain
