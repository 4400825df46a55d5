"""ArduPilot/ardupilot, Tools/autotest/arducopter.py (and vehicle_test_suite.py, which it uses).

Compared with the source: the modes without arming, and the names
DO_CHANGE_SPEED_in_guided, MAV_CMD_DO_FLIGHTTERMINATION and MAV_CMD_MISSION_START_p1_p2. The other names are
given from knowledge of the suite and not compared, and the figures of those tests are this project's. The
angles of CONDITION_YAW are those of the suite's test of another kind of vehicle.
"""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as dialect

from tests.clients.conformance.stand import (
    ARM,
    COPTER,
    FAIL,
    LOITER,
    PHYSICS,
    RTL,
    SET_MODE,
    SPEED,
    START,
    YAW,
    Stand,
    place,
    position_target,
    reposition,
    velocity_target,
)
from tests.sitl.mission_client import Way, at, download, upload

pytestmark = pytest.mark.slow
TAKE_OFF, POSITION_ONLY = 22, 0xDF8


@pytest.fixture(params=PHYSICS)
def copter(request: pytest.FixtureRequest) -> Stand:
    return Stand("ardupilot", failures="obeyed", physics=request.param)


def rtl_complete(client: Stand) -> None:
    """``do_RTL``: disarmed, and where it began."""
    assert client.command(SET_MODE, 1, COPTER["RTL"]) == 0
    client.until_disarmed(250.0)
    assert client.from_home() < 2.0


def global_target(north: float, east: float, height: float) -> Any:
    x, y = place(north, east)
    return dialect.MAVLink_set_position_target_global_int_message(
        0, 11, 1, 6, POSITION_ONLY, x, y, height, 0, 0, 0, 0, 0, 0, 0, 0
    )


def test_guided_moves_and_stops(copter: Stand) -> None:
    """GuidedSubModeChange: moves by global and local targets, stops to 0.05 m/s, returns."""
    copter.take_off(10.0)
    copter.send(global_target(5, 0, 10))
    copter.until(lambda: math.dist(copter.position[:2], (5, 0)) < 1.0, 100.0)
    copter.send(position_target(0, 0, 0, frame=8, mask=POSITION_ONLY))
    copter.until(lambda: copter.speed < 0.05 and abs(copter.last("VFR_HUD").climb) < 0.01, 20.0)
    copter.send(position_target(5, 5, -10, mask=POSITION_ONLY))
    copter.until(lambda: copter.distance((5, 5, -10)) < 1.0, 100.0)
    rtl_complete(copter)


@pytest.mark.parametrize("integer", [False, True])
def test_condition_yaw(copter: Stand, integer: bool) -> None:
    """MAV_CMD_CONDITION_YAW, by COMMAND_LONG and COMMAND_INT: absolute and relative angles are held."""
    copter.take_off(10.0)

    def turn(angle: float, direction: int, relative: int) -> int:
        values = (angle, 10.0, float(direction), float(relative))
        if not integer:
            return copter.command(YAW, *values)
        found = copter.send(dialect.MAVLink_command_int_message(11, 1, 0, YAW, 0, 0, *values, 0, 0, 0.0))
        return int(next(m for m in found if m.get_type() == "COMMAND_ACK").result)

    def off(angle: float) -> float:
        return abs((copter.heading - angle + 180.0) % 360.0 - 180.0)

    for angle in (5, 30, 60, 10):
        assert turn(angle, 1, 0) == 0
        copter.held(lambda angle=angle: off(angle) < 5.0, 2.0, 30.0)
    assert turn(0, 1, 0) == 0
    copter.until(lambda: off(0) < 2.0, 30.0)
    copter.wait(2.0)
    assert turn(20, 1, 1) == 0
    copter.held(lambda: off(20) < 5.0, 2.0, 30.0)
    assert turn(20, -1, 1) == 0
    copter.until(lambda: off(0) < 5.0, 30.0)


def test_loss_of_gps_lands_and_recovery_allows_guided(copter: Stand) -> None:
    """EKF failsafe by loss of GPS: LAND; with GPS again, GUIDED is accepted and the vehicle returns."""
    copter.take_off(20.0)
    assert copter.command(FAIL, 4, 1, 0) == 0
    copter.until(lambda: copter.mode == COPTER["LAND"], 60.0)
    assert any("EKF" in text for text in copter.texts)
    assert copter.command(FAIL, 4, 0, 0) == 0
    copter.wait(3.0)
    assert copter.command(SET_MODE, 1, COPTER["GUIDED"]) == 0
    rtl_complete(copter)


def test_short_loss_of_gps_does_no_harm(copter: Stand) -> None:
    """GPSGlitchLoiter: a fault of a few seconds leaves the mode; the vehicle is where it was."""
    copter.take_off(10.0)
    assert copter.command(SET_MODE, 1, COPTER["LOITER"]) == 0
    assert copter.command(FAIL, 4, 1, 0) == 0
    copter.wait(3.0)
    assert copter.command(FAIL, 4, 0, 0) == 0
    copter.stays(lambda: copter.mode == COPTER["LOITER"] and copter.from_home() < 5.0, 10.0)


def test_mission_items_round_trip(copter: Stand) -> None:
    """MissionItems of vehicle_test_suite.py: what goes up comes back, in its order."""
    plan = [Way(16), at(0, 0, 20, TAKE_OFF), at(30, 0, 20), at(30, 30, 20), Way(RTL, frame=2)]
    assert upload(copter, plan) == 0
    back = download(copter)
    assert [m.command for m in back] == [way.command for way in plan]
    assert [(m.x, m.y, m.z) for m in back[1:4]] == [(way.x, way.y, way.z) for way in plan[1:4]]


def test_mission_is_flown_and_ends_disarmed(copter: Stand) -> None:
    """CopterMission: every item is reached in its order; RTL at the end disarms at home."""
    copter.fly_mission([at(0, 0, 20, TAKE_OFF), at(30, 0, 20), at(30, 30, 20), Way(RTL, frame=2)])
    copter.until_disarmed(300.0)
    reached = [m.seq for m in copter.of("MISSION_ITEM_REACHED")]
    assert reached[:3] == [1, 2, 3]
    assert copter.from_home() < 2.0


def test_rtl_speed(copter: Stand) -> None:
    """RTLSpeed: RTL_SPEED is the speed of the way home, within 0.5 m/s (here by WPNAV_SPEED)."""
    copter.take_off(15.0)
    copter.set_parameter("WPNAV_SPEED", 400.0)
    assert reposition(copter, 60.0, 0.0, 15.0) == 0
    copter.until(lambda: math.dist(copter.position[:2], (60, 0)) < 1.0, 60.0)
    assert copter.command(SET_MODE, 1, COPTER["RTL"]) == 0
    copter.until(lambda: copter.speed > 3.5, 30.0)
    copter.stays(lambda: abs(copter.speed - 4.0) < 0.5, 5.0)


def test_max_altitude_fence(copter: Stand) -> None:
    """MaxAltFence: climbing through FENCE_ALT_MAX enters RTL, which disarms at home."""
    copter.set_parameter("FENCE_ENABLE", 1)
    copter.set_parameter("FENCE_TYPE", 1)
    copter.set_parameter("FENCE_ALT_MAX", 20.0)
    copter.take_off(10.0)
    target = velocity_target(0, 0, -1.5)
    copter.until(lambda: copter.mode == COPTER["RTL"], 60.0, lambda: target)
    copter.until_disarmed(250.0)


def test_circle_fence(copter: Stand) -> None:
    """HorizontalFence: leaving FENCE_RADIUS enters RTL, which disarms at home."""
    copter.set_parameter("FENCE_ENABLE", 1)
    copter.set_parameter("FENCE_TYPE", 2)
    copter.set_parameter("FENCE_RADIUS", 30.0)
    copter.take_off(10.0)
    copter.until(lambda: copter.mode == COPTER["RTL"], 60.0, lambda: velocity_target(4, 0, 0))
    copter.until_disarmed(250.0)
    assert copter.from_home() < 2.0


def test_battery_failsafe(copter: Stand) -> None:
    """BatteryFailsafe: BATT_FS_LOW_ACT 2 (RTL) and 1 (LAND) act on a low voltage."""
    copter.set_parameter("BATT_FS_LOW_ACT", 2)
    copter.take_off(10.0)
    copter.set_parameter("BATT_LOW_VOLT", 12.5)
    copter.until(lambda: copter.mode == COPTER["RTL"], 60.0)
    copter.until_disarmed(250.0)


def test_land_by_battery(copter: Stand) -> None:
    """BatteryFailsafe: BATT_FS_CRT_ACT 1 lands."""
    copter.set_parameter("BATT_FS_CRT_ACT", 1)
    copter.take_off(10.0)
    copter.set_parameter("BATT_CRT_VOLT", 12.5)
    copter.until(lambda: copter.mode == COPTER["LAND"], 60.0)
    copter.until_disarmed(100.0)


def test_loiter_and_return_by_command(copter: Stand) -> None:
    """MAV_CMD_NAV_LOITER_UNLIM, MAV_CMD_NAV_RETURN_TO_LAUNCH: modes LOITER and RTL."""
    copter.take_off(10.0)
    assert copter.command(LOITER) == 0
    copter.until(lambda: copter.mode == COPTER["LOITER"], 3.0)
    assert copter.command(RTL) == 0
    copter.until(lambda: copter.mode == COPTER["RTL"], 3.0)
    copter.until_disarmed(250.0)


def test_flight_termination(copter: Stand) -> None:
    """MAV_CMD_DO_FLIGHTTERMINATION: disarmed at once, wherever it is."""
    copter.take_off(10.0)
    assert copter.command(185, 1) == 0
    copter.until(lambda: not copter.armed, 3.0)


def test_pause_and_continue_in_guided(copter: Stand) -> None:
    """PauseResumeGuided… (DO_PAUSE_CONTINUE): stops on the way, and arrives after going on."""
    copter.take_off(10.0)
    assert reposition(copter, 100.0, 0.0, 10.0) == 0
    copter.until(lambda: copter.position[0] > 20.0, 60.0)
    assert copter.command(193, 0) == 0
    copter.until(lambda: copter.speed < 0.1, 30.0)
    assert copter.position[0] < 90.0
    assert copter.command(193, 1) == 0
    copter.until(lambda: math.dist(copter.position[:2], (100, 0)) < 1.0, 60.0)


def test_bad_set_points_change_nothing(copter: Stand) -> None:
    """SetpointBadVel: a velocity that is not a number does not move the vehicle."""
    copter.take_off(10.0)
    before = copter.position
    copter.stays(lambda: copter.distance(before) < 1.0, 5.0, lambda: velocity_target(math.nan, 1, 0))


@pytest.mark.parametrize("frame", [1, 7, 8, 9])
def test_velocity_set_points(copter: Stand, frame: int) -> None:
    """SetpointGlobalVel / fly_guided_move_local: the commanded velocity is taken up in each frame."""
    copter.take_off(10.0)
    target = velocity_target(0, 2, 0, frame=frame, mask=0xDC7)
    copter.held(lambda: abs(copter.last("LOCAL_POSITION_NED").vy - 2.0) < 0.2, 3.0, 20.0, lambda: target)


def test_change_of_speed_in_guided(copter: Stand) -> None:
    """DO_CHANGE_SPEED_in_guided: the new speed within 0.5 m/s."""
    copter.take_off(10.0)
    assert reposition(copter, 300.0, 0.0, 10.0) == 0
    for speed in (5.0, 3.0):
        assert copter.command(SPEED, 1, speed, -1) == 0
        copter.held(lambda speed=speed: abs(copter.speed - speed) < 0.5, 5.0, 40.0)


def test_take_off_by_mission_start(copter: Stand) -> None:
    """MAV_CMD_MISSION_START_p1_p2: MISSION_START in AUTO, armed on the ground, takes off."""
    assert upload(copter, [Way(16), at(0, 0, 10, TAKE_OFF), Way(RTL, frame=2)]) == 0
    assert copter.command(SET_MODE, 1, COPTER["GUIDED"]) == 0
    assert copter.command(ARM, 1) == 0
    assert copter.command(SET_MODE, 1, COPTER["AUTO"]) == 0
    assert copter.command(START) == 0
    copter.until(lambda: copter.position[2] < -9.0, 30.0)
    copter.until_disarmed(250.0)


def test_not_armable_modes(copter: Stand) -> None:
    """get_not_armable_mode_list: arming is refused in AUTO, BRAKE, LAND and RTL."""
    assert upload(copter, [Way(16), at(0, 0, 10, TAKE_OFF), Way(RTL, frame=2)]) == 0
    for mode in ("AUTO", "BRAKE", "LAND", "RTL"):
        assert copter.command(SET_MODE, 1, COPTER[mode]) == 0, mode
        assert copter.command(ARM, 1) == 4, mode
