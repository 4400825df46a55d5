"""Commands in flight: to a place, at a speed, wait, turn, follow, terminate."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as dialect
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import Attitude, CommandAck, CommandInt, FollowTarget, GlobalPosition, Source
from mavlink_bridge.wire.codec import Codec
from sitl.autopilot.firmware import Mode
from tests.sitl.autopilot_rig import FLAVOURS, PILOT, SET_MODE, SITE, VELOCITY_YAW, Rig, setpoint
from tests.sitl.mission_client import at, upload
from tests.sitl.outside_client import Client

LOITER, FOLLOW, YAW, SPEED, TERMINATE, REPOSITION, PAUSE, CHECK = 17, 32, 115, 178, 185, 192, 193, 401
START, RETURN = 300, 20
ACCEPTED, TEMPORARILY_REJECTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
DENIED, UNSUPPORTED = mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_UNSUPPORTED
FAILED = mavlink.MAV_RESULT_FAILED
ABOVE_HOME = 6
NAN = math.nan
LEADER = Source(42, 1)


def place(north, east):
    latitude, longitude, _ = SITE.to_geodetic((east, north, 0.0))
    return latitude, longitude


def reposition(rig, north, east, up, *, speed=-1.0, flags=0, yaw=NAN, frame=ABOVE_HOME):
    """The results of a DO_REPOSITION as COMMAND_INT."""
    latitude, longitude = place(north, east)
    seen = len(rig.received)
    params = (speed, float(flags), 0.0, yaw)
    where = round(latitude * 1e7), round(longitude * 1e7), up
    rig.step(CommandInt(PILOT, 11, 1, frame, REPOSITION, params, *where))
    return [m.result for _, m in rig.received[seen:] if isinstance(m, CommandAck)]


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_reposition_flies_to_a_place_no_faster_than_asked(flavour):
    rig = Rig(flavour).hover(5.0)
    assert reposition(rig, 20.0, -10.0, 9.0, speed=2.0, flags=1, yaw=0.7) == [ACCEPTED]
    fastest = 0.0
    for _ in range(200):
        rig.run(0.1)
        fastest = max(fastest, rig.speed)
    assert fastest == pytest.approx(2.0, abs=0.05)
    assert np.linalg.norm(rig.position - (20.0, -10.0, -9.0)) < 0.1
    assert rig.autopilot.mode is (Mode.GUIDED if flavour == "ardupilot" else Mode.HOLD)
    # Only PX4 reads a yaw from it; an ArduCopter faces its way.
    faced = math.atan2(-10.0, 20.0)
    assert rig.autopilot.estimate.yaw == pytest.approx(0.7 if flavour == "px4" else faced, abs=0.02)
    if flavour == "ardupilot":
        assert reposition(rig, 20.0, -9.0, 9.0) == [ACCEPTED]
        rig.run(5.0)
        assert rig.autopilot.estimate.yaw == pytest.approx(faced, abs=0.02)


def test_reposition_changes_the_mode_only_if_it_may():
    rig = Rig("ardupilot").hover(5.0)
    assert rig.order(LOITER) == [ACCEPTED]
    assert rig.autopilot.mode is Mode.POSITION
    assert reposition(rig, 5.0, 0.0, 5.0) == [DENIED]
    assert rig.autopilot.mode is Mode.POSITION
    assert reposition(rig, 5.0, 0.0, 5.0, flags=1) == [ACCEPTED]
    rig.run(8.0)
    assert rig.autopilot.mode is Mode.GUIDED
    assert np.linalg.norm(rig.position - (5.0, 0.0, -5.0)) < 0.1


def test_an_arducopter_needs_frame_and_place():
    rig = Rig("ardupilot").hover(5.0)
    assert reposition(rig, 5.0, 0.0, 5.0, frame=1) == [DENIED]
    assert reposition(rig, 5.0, 0.0, NAN) == [DENIED]
    assert rig.order(REPOSITION, -1, 0, 0, NAN, *place(5.0, 0.0), 5.0) == [DENIED]
    rig.run(2.0)
    assert rig.speed < 0.02


def test_px4_takes_what_is_no_number_for_as_it_is():
    rig = Rig("px4").hover(5.0)
    assert rig.order(REPOSITION, -1, 1, 0, NAN, NAN, NAN, SITE.altitude + 8.0) == [ACCEPTED]
    rig.run(8.0)
    assert np.linalg.norm(rig.position - (0.0, 0.0, -8.0)) < 0.1
    assert rig.order(REPOSITION, -1, 1, 0, NAN, *place(4.0, 0.0), NAN) == [ACCEPTED]
    rig.run(8.0)
    assert np.linalg.norm(rig.position - (4.0, 0.0, -8.0)) < 0.1


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_nothing_on_the_ground_moves_by_reposition(flavour):
    rig = Rig(flavour)
    assert reposition(rig, 5.0, 0.0, 5.0, flags=1) == [TEMPORARILY_REJECTED]
    rig.run(1.1)
    assert reposition(rig, 5.0, 0.0, 5.0, flags=1) == [ACCEPTED]
    rig.run(2.0)
    assert not rig.autopilot.armed
    assert np.linalg.norm(rig.position[:2]) < 1e-6


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_another_speed_holds_for_the_way_that_is_flown(flavour):
    rig = Rig(flavour).hover(5.0)
    assert reposition(rig, 250.0, 0.0, 5.0, flags=1) == [ACCEPTED]
    rig.run(11.0)
    assert rig.speed == pytest.approx(rig.config.waypoint_speed, abs=0.05)
    assert rig.order(SPEED, 1, 2.0) == [ACCEPTED]
    rig.run(8.0)
    assert rig.speed == pytest.approx(2.0, abs=0.05)
    assert rig.order(SPEED, 1, -1.0) == [ACCEPTED]
    assert rig.order(SPEED, 1, -2.0) == [ACCEPTED]
    rig.run(9.0)
    assert rig.speed == pytest.approx(rig.config.waypoint_speed, abs=0.05)
    for bad in ((1, 0.0), (1, NAN), (1, -3.0), (7, 2.0), (NAN, 2.0)):
        assert rig.order(SPEED, *bad) == [DENIED]
    assert rig.order(SPEED, 2, 2.0) == [UNSUPPORTED]


def test_another_speed_counts_in_a_mission():
    rig = Rig("ardupilot").hover(5.0)
    assert upload(Client(rig), [at(0, 0, 0), at(200.0, 0.0, 5.0), at(400.0, 0.0, 5.0)]) == 0
    assert rig.order(SET_MODE, 1, 3) == [ACCEPTED]
    assert rig.order(SPEED, 1, 2.0) == [ACCEPTED]
    rig.run(6.0)
    assert rig.speed == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("how", ["reposition", "set-point", "mission"])
def test_a_pause_stops_and_going_on_goes_on(how):
    rig = Rig("ardupilot").hover(5.0)
    forward = setpoint(VELOCITY_YAW, velocity=(3.0, 0.0, 0.0)) if how == "set-point" else ()
    told = (forward,) if forward else ()
    if how == "reposition":
        assert reposition(rig, 60.0, 0.0, 5.0) == [ACCEPTED]
    if how == "mission":
        assert upload(Client(rig), [at(0, 0, 0), at(60.0, 0.0, 5.0)]) == 0
        assert rig.order(SET_MODE, 1, 3) == [ACCEPTED]
    rig.run(3.0, *told)
    assert rig.speed > 2.0
    assert rig.order(PAUSE, 0) == [ACCEPTED]
    rig.run(5.0, *told)
    assert rig.speed < 0.02
    stopped = rig.position
    rig.run(1.0, *told)
    assert np.linalg.norm(rig.position - stopped) < 0.02
    assert rig.order(PAUSE, 1) == [ACCEPTED]
    rig.run(3.0, *told)
    assert rig.position[0] > stopped[0] + 2.0


def test_set_points_that_end_in_a_pause_are_not_gone_on_with():
    rig = Rig("ardupilot").hover(5.0)
    rig.run(2.0, setpoint(VELOCITY_YAW, velocity=(3.0, 0.0, 0.0)))
    assert rig.order(PAUSE, 0) == [ACCEPTED]
    rig.run(6.0)
    stopped = rig.position
    assert rig.order(PAUSE, 1) == [ACCEPTED]
    rig.run(2.0)
    assert np.linalg.norm(rig.position - stopped) < 0.1


def test_another_mode_ends_a_pause():
    rig = Rig("ardupilot").hover(5.0)
    assert reposition(rig, 60.0, 0.0, 5.0) == [ACCEPTED]
    rig.run(2.0)
    assert rig.order(PAUSE, 0) == [ACCEPTED]
    assert rig.order(PAUSE, 0.5) == [DENIED]
    assert rig.order(LOITER) == [ACCEPTED]
    assert rig.order(PAUSE, 1) == [DENIED]
    rig.run(4.0)
    assert rig.speed < 0.02


def test_px4_has_neither_pause_nor_yaw_nor_follow_commands():
    rig = Rig("px4").hover(5.0)
    assert [rig.order(command, 1)[0] for command in (PAUSE, YAW, FOLLOW)] == [UNSUPPORTED] * 3


def test_yaw_turns_to_an_angle_or_by_one():
    rig = Rig("ardupilot").hover(5.0)
    assert rig.order(YAW, 90, 0, 1, 0) == [ACCEPTED]
    rig.run(3.0)
    assert rig.autopilot.estimate.yaw == pytest.approx(math.pi / 2, abs=0.01)
    assert rig.order(YAW, 30, 0, -1, 1) == [ACCEPTED]
    rig.run(3.0)
    assert rig.autopilot.estimate.yaw == pytest.approx(math.pi / 3, abs=0.01)
    assert rig.order(YAW, NAN, 0, 1, 0) == [DENIED]
    assert rig.order(LOITER) == [ACCEPTED]
    assert rig.order(YAW, 90, 0, 1, 0) == [FAILED]


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_termination_stops_the_motors_in_flight(flavour):
    rig = Rig(flavour).hover(5.0)
    assert rig.order(TERMINATE, 0) == [ACCEPTED]
    assert rig.autopilot.armed
    assert rig.order(TERMINATE, 1) == [ACCEPTED]
    assert not rig.autopilot.armed
    rig.run(3.0)
    assert -rig.position[2] < 0.2


def leader(t, *, speed, kind):
    """One who goes north, 12 m east of home and 4 m above it."""
    latitude, longitude = place(speed * t, 12.0)
    velocity = (speed, 0.0, 0.0)
    if kind is FollowTarget:
        return FollowTarget(LEADER, round(t * 1e6), latitude, longitude, SITE.altitude + 4.0, velocity)
    return GlobalPosition(
        LEADER, round(t * 1e6), latitude, longitude, SITE.altitude + 4.0, 4.0, velocity, 0.0
    )


def test_a_leader_that_does_not_know_its_velocity_is_followed():
    nan = [math.nan] * 3
    message = dialect.MAVLink_follow_target_message(
        0, 3, 10, 20, 30.0, nan, [0] * 3, [1, 0, 0, 0], [0] * 3, [0] * 3, 0
    )
    (received,) = Codec().feed(message.pack(dialect.MAVLink(None, srcSystem=1)))
    assert received.velocity is None
    assert received.altitude == 30.0


def follow(rig, seconds, kind=FollowTarget, speed=3.0):
    """What it was off from the leader (n, 3), m, at 5 Hz."""
    found = []
    for k in range(round(5 * seconds)):
        t = 0.2 * k
        rig.step(leader(t, speed=speed, kind=kind))
        rig.run(0.2 - rig.tick * 1e-6)
        found.append(rig.position - (speed * (t + 0.2), 12.0, -4.0))
    return np.array(found)


@pytest.mark.parametrize("kind", [FollowTarget, GlobalPosition])
def test_an_arducopter_follows_at_its_offset(kind):
    offsets = {"follow": {"enabled": "on", "system": 42, "x": -5.0, "y": 2.0, "z": -3.0}}
    rig = Rig("ardupilot", **offsets).hover(5.0)
    assert rig.order(SET_MODE, 1, 23) == [ACCEPTED]
    off = follow(rig, 20.0, kind)
    assert np.abs(off[-20:] - (-5.0, 2.0, -3.0)).max() < 0.15
    # Silence: it stops where it is.
    rig.run(7.0)
    assert rig.speed < 0.05
    assert rig.autopilot.mode is Mode.FOLLOW


def test_without_an_offset_it_keeps_the_one_it_has():
    rig = Rig("ardupilot", follow={"enabled": "on"}).hover(5.0)
    assert rig.order(SET_MODE, 1, 23) == [ACCEPTED]
    off = follow(rig, 20.0)
    assert np.abs(off[-20:] - (0.0, -12.0, -1.0)).max() < 0.15


def test_whom_to_follow_can_be_said_and_nobody_else_is():
    rig = Rig("ardupilot", follow={"enabled": "on", "system": 7}).hover(5.0)
    assert rig.order(SET_MODE, 1, 23) == [ACCEPTED]
    follow(rig, 2.0)
    assert np.linalg.norm(rig.position - (0.0, 0.0, -5.0)) < 0.05
    assert rig.order(FOLLOW, 0) == [DENIED]
    assert rig.order(FOLLOW, NAN) == [DENIED]
    assert rig.order(FOLLOW, 42) == [ACCEPTED]
    follow(rig, 4.0)
    assert rig.speed > 1.0


def test_who_is_too_far_off_is_not_followed():
    rig = Rig("ardupilot", follow={"enabled": "on", "limit": 5.0}).hover(5.0)
    assert rig.order(SET_MODE, 1, 23) == [ACCEPTED]
    follow(rig, 3.0)
    assert rig.speed < 0.02


def test_px4_follows_behind_at_its_height_and_looks_at_the_leader():
    rig = Rig("px4").hover(5.0)
    assert rig.order(SET_MODE, 1, 4, 8) == [ACCEPTED]
    off = follow(rig, 25.0)
    assert np.abs(off[-20:] - (-8.0, 0.0, -4.0)).max() < 0.15
    assert rig.autopilot.estimate.yaw == pytest.approx(0.0, abs=0.05)
    # Its own vehicles' positions are no targets for it.
    stopped = Rig("px4").hover(5.0)
    assert stopped.order(SET_MODE, 1, 4, 8) == [ACCEPTED]
    follow(stopped, 3.0, GlobalPosition)
    assert stopped.speed < 0.02


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_checks_say_what_speaks_against_arming(flavour):
    rig = Rig(flavour)
    rig.step()
    assert rig.order(CHECK) == [ACCEPTED]
    prefix = "PreArm: " if flavour == "ardupilot" else "Preflight Fail: "
    assert rig.texts == [f"{prefix}no position yet"]
    rig.run(1.1)
    rig.received.clear()
    assert rig.order(CHECK) == [ACCEPTED]
    assert rig.texts == []


@pytest.mark.parametrize(("flavour", "result"), [("ardupilot", TEMPORARILY_REJECTED), ("px4", ACCEPTED)])
def test_only_px4_runs_its_checks_while_armed(flavour, result):
    rig = Rig(flavour).hover(5.0)
    assert rig.order(CHECK) == [result]


# What a look at all of it together had found


def turning(rig):
    return bool((rig.autopilot.state.rotor_speeds > 1.0).any())


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("mode", ["follow", "return"])
def test_nothing_turns_the_motors_of_a_vehicle_that_is_not_armed(flavour, mode):
    numbers = {
        ("ardupilot", "follow"): (1, 23),
        ("ardupilot", "return"): (1, 6),
        ("px4", "follow"): (1, 4, 8),
        ("px4", "return"): (1, 4, 5),
    }
    rig = Rig(flavour, follow={"enabled": "on", "z": -3.0})
    rig.run(1.1)
    assert rig.order(SET_MODE, *numbers[flavour, mode]) == [ACCEPTED]
    follow(rig, 3.0)
    assert not turning(rig)
    # Nor does it leave the ground when it is armed there by force, or later, in another mode.
    assert rig.order(400, 1, 21196) == [ACCEPTED]
    follow(rig, 3.0)
    assert -rig.position[2] < 0.1


def test_a_vehicle_that_was_cut_in_follow_stays_down_when_it_is_armed_again():
    rig = Rig("px4").hover(5.0)
    assert rig.order(SET_MODE, 1, 4, 8) == [ACCEPTED]
    follow(rig, 2.0)
    assert rig.order(TERMINATE, 1) == [ACCEPTED]
    follow(rig, 4.0)
    assert not turning(rig)
    assert rig.order(400, 1) == [ACCEPTED]
    here = rig.position.copy()
    follow(rig, 3.0)
    assert np.linalg.norm(rig.position - here) < 0.1


def test_px4_follows_no_leader_on_the_other_side_of_the_world():
    rig = Rig("px4").hover(5.0)
    assert rig.order(SET_MODE, 1, 4, 8) == [ACCEPTED]
    rig.run(2.0, FollowTarget(LEADER, 1, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0)))
    assert rig.speed < 0.02


def test_another_parameter_changes_nothing_of_what_is_flown():
    rig = Rig("ardupilot").hover(5.0)
    client = Client(rig)
    assert reposition(rig, 60.0, 0.0, 5.0) == [ACCEPTED]
    assert rig.order(SPEED, 1, 1.0) == [ACCEPTED]
    name = b"RC1_TRIM".ljust(16, b"\0")
    client.send(dialect.MAVLink_param_set_message(11, 1, name, 1501.0, 4))
    rig.run(6.0)
    assert rig.speed == pytest.approx(1.0, abs=0.05)


def test_a_pause_is_refused_where_it_cannot_be():
    rig = Rig("ardupilot")
    rig.run(1.1)
    assert rig.guided() == [ACCEPTED]
    assert rig.order(400, 1) == [ACCEPTED]
    assert rig.order(22, 0, 0, 0, 0, 0, 0, 10.0) == [ACCEPTED]
    rig.run(1.0)
    assert rig.order(PAUSE, 0) == [FAILED]


def test_a_stop_outside_guided_stops_nothing():
    rig = Rig("ardupilot", follow={"enabled": "on"}).hover(5.0)
    assert rig.order(SET_MODE, 1, 23) == [ACCEPTED]
    follow(rig, 4.0)
    speed = rig.speed
    assert speed > 1.0
    rig.step(setpoint(VELOCITY_YAW, velocity=(0.0, 0.0, 0.0), frame=20))
    rig.run(0.1)
    assert rig.speed == pytest.approx(speed, abs=0.3)


def test_what_cannot_be_told_is_left_out_and_the_rest_is_told():
    rig = Rig("ardupilot").hover(5.0)
    rig.autopilot._aircraft.navigation.home.altitude = -3.0e6
    rig.received.clear()
    rig.run(2.0)
    assert rig.all(GlobalPosition) == []
    assert len(rig.all(Attitude)) > 50
    assert rig.autopilot.not_encoded > 0
