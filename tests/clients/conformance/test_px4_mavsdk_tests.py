"""PX4/PX4-Autopilot, test/mavsdk_tests: flights of a multicopter."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as dialect

from tests.clients.conformance.stand import (
    ARM,
    FAIL,
    LAND,
    NAN,
    PHYSICS,
    PX4_MODES,
    RTL,
    SET_MODE,
    SPEED,
    Stand,
    place,
    position_target,
    reposition,
    velocity_target,
)
from tests.sitl.autopilot_rig import SITE
from tests.sitl.ftp_client import NAK, Ftp
from tests.sitl.mission_client import Way, at

pytestmark = pytest.mark.slow
TAKE_OFF, REPOSITION_HERE, CREATE = 22, 192, 6


@pytest.fixture(params=PHYSICS)
def px4(request: pytest.FixtureRequest) -> Stand:
    return Stand("px4", physics=request.param)


def offboard_goto(client: Stand, x: float, y: float, z: float, yaw: float, seconds: float) -> None:
    """``offboard_goto`` of autopilot_tester.cpp: within 0.3 m of the target in the given time."""
    target = position_target(x, y, z, yaw)
    client.send(target)
    assert client.command(SET_MODE, 1, 6) == 0
    client.until(lambda: client.distance((x, y, z)) < 0.3, seconds, lambda: target)


def offboard_land(client: Stand) -> None:
    client.until(lambda: not client.armed, 120.0, lambda: velocity_target(0, 0, 1.0))
    assert client.from_home() < 2.0


def test_offboard_takeoff_and_land(px4: Stand) -> None:
    """test_multicopter_offboard.cpp, "Offboard takeoff and land"."""
    px4.send(position_target(0, 0, -2))
    assert px4.command(ARM, 1) == 0
    offboard_goto(px4, 0, 0, -2, 0, 90.0)
    offboard_land(px4)


def test_offboard_position_control(px4: Stand) -> None:
    """test_multicopter_offboard.cpp, "Offboard position control": each leg within 10 s."""
    px4.send(position_target(0, 0, -2))
    assert px4.command(ARM, 1) == 0
    for leg in ((0, 0, -2, 0), (0, 5, -2, 180), (5, 5, -4, 180), (5, 0, -4, 90), (0, 0, -2, 0)):
        offboard_goto(px4, *leg, 10.0)
    offboard_land(px4)


def test_offboard_attitude_control(px4: Stand) -> None:
    """test_multicopter_offboard.cpp, "Offboard attitude control"; fly_forward_in_offboard_attitude."""

    def attitude(pitch: float, thrust: float) -> object:
        q = (math.cos(math.radians(pitch) / 2), 0.0, math.sin(math.radians(pitch) / 2), 0.0)
        return dialect.MAVLink_set_attitude_target_message(0, 11, 1, 7, q, 0, 0, 0, thrust)

    for _ in range(20):
        px4.send(attitude(0, 0.0))
        px4.wait(0.04)
    assert px4.command(SET_MODE, 1, 6) == 0
    assert px4.command(ARM, 1) == 0
    px4.until(lambda: px4.position[2] < -10.0, 20.0, lambda: attitude(0, 0.8))
    start = px4.position[0]
    px4.stays(lambda: px4.armed, 3.0, lambda: attitude(-10, 0.5))
    assert px4.position[0] > start + 1.0
    px4.until(lambda: not px4.armed, 120.0, lambda: attitude(0, 0.3))


@pytest.mark.parametrize("velocity", [True, False])
def test_follow_target_in_a_straight_line(px4: Stand, velocity: bool) -> None:
    """autopilot_tester_follow_me.cpp, straight_line_test: 75 updates with noise, four angles, 8 m, ±11 m."""
    px4.take_off(10.0)
    for name, value in (("FLW_TGT_HT", 10.0), ("FLW_TGT_DST", 8.0), ("FLW_TGT_FA", 0.0)):
        px4.set_parameter(name, value)
    assert px4.command(SET_MODE, *PX4_MODES["follow"]) == 0
    random = np.random.default_rng(1)
    north, checks = 0.0, 0
    angles = {5: 180.0, 20: 0.0, 35: 45.0, 55: -45.0}
    angle = 0.0
    for index in range(75):
        here = px4.position
        if index in angles:
            angle = angles[index]
            px4.set_parameter("FLW_TGT_FA", angle)
        elif any(low <= index < high for low, high in ((15, 20), (30, 35), (45, 55), (65, 75))):
            checks += 1
            assert abs(-here[2] - 10.0) < 1.5
            assert abs(math.dist(here, (north, 0.0, 0.0)) - 8.0) <= 11.0
            assert abs(here[0] - north - 8.0 * math.cos(math.radians(angle))) < 11.0
            assert abs(here[1] - 8.0 * math.sin(math.radians(angle))) < 11.0
        north += 2.0 if index > 5 else 0.0
        x, y, z = np.array((north, 0.0, 0.0)) + random.normal(0.0, 1.0, 3)
        u, v, w = np.array((2.0 if index > 5 else 0.0, 0.0, 0.0)) + random.normal(0.0, 0.1, 3)
        speed = (u, v, w) if velocity else (NAN, NAN, NAN)
        lat, lon = place(x, y)
        px4.send(
            dialect.MAVLink_follow_target_message(
                0,
                3 if velocity else 1,
                lat,
                lon,
                SITE.altitude - z,
                speed,
                [0] * 3,
                [1, 0, 0, 0],
                [0] * 3,
                [0] * 3,
                0,
            )
        )
        px4.wait(0.99)
    assert checks == 30


def test_follow_target_with_velocity_alone_stays(px4: Stand) -> None:
    """autopilot_tester_follow_me.cpp, stream_velocity_only: less than 4 m in 15 updates."""
    px4.take_off(10.0)
    assert px4.command(SET_MODE, *PX4_MODES["follow"]) == 0
    before = px4.position
    for _ in range(15):
        px4.send(
            dialect.MAVLink_follow_target_message(
                0, 2, 0, 0, NAN, (2.0, 1.0, 0.5), [0] * 3, [1, 0, 0, 0], [0] * 3, [0] * 3, 0
            )
        )
        px4.wait(0.99)
    assert px4.distance(before) < 4.0


def test_takeoff_and_land(px4: Stand) -> None:
    """test_multicopter_mission.cpp, "Takeoff and Land"."""
    px4.take_off(2.5)
    assert px4.command(LAND) == 0
    px4.until_disarmed(180.0)


SQUARE = [at(0, 0, 10, TAKE_OFF), at(20, 0, 10), at(20, 20, 10), at(0, 20, 10)]


def off_legs(point: tuple[float, float], corners: list[tuple[float, float]]) -> float:
    """Distance (m) of a point from the legs between ``corners``."""
    best = math.inf
    for a, b in pairwise(corners):
        length = math.dist(a, b) or 1.0
        t = ((point[0] - a[0]) * (b[0] - a[0]) + (point[1] - a[1]) * (b[1] - a[1])) / length**2
        t = max(0.0, min(1.0, t))
        best = min(best, math.dist(point, (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]))))
    return best


def test_square_mission_with_rtl(px4: Stand) -> None:
    """test_multicopter_mission.cpp, "Fly square Multicopter Missions including RTL": disarmed in 180 s."""
    px4.fly_mission([*SQUARE, Way(RTL, frame=2)])
    px4.until_disarmed(180.0)
    assert px4.from_home() < 2.0


def test_square_mission_with_manual_rtl_in_its_corridor(px4: Stand) -> None:
    """test_multicopter_mission.cpp, "… with manual RTL"; check_tracks_mission(5.f)."""
    corners = [(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0)]
    worst = [0.0]

    def watch() -> None:
        worst[0] = max(worst[0], off_legs(px4.position[:2], corners))

    px4.fly_mission(SQUARE)
    last = len(SQUARE) - 1
    px4.until(lambda: any(m.seq == last for m in px4.of("MISSION_ITEM_REACHED")), 180.0, watch=watch)
    assert worst[0] < 5.0
    assert px4.command(RTL) == 0
    px4.until_disarmed(180.0)


def test_straight_mission_keeps_its_speed(px4: Stand) -> None:
    """test_multicopter_mission.cpp, "Fly straight Multicopter Mission": above 4 m/s to item 2."""
    px4.fly_mission([at(0, 0, 10, TAKE_OFF), *(at(20.0 * k, 0, 10) for k in range(5))])
    # Item 2 of the suite's list is 40 m away, the fourth of this one, which has the take-off before it.
    px4.until(lambda: any(m.seq == 2 for m in px4.of("MISSION_ITEM_REACHED")), 120.0)
    slowest = [math.inf]

    def watch() -> None:
        slowest[0] = min(slowest[0], px4.speed)

    px4.until(lambda: any(m.seq == 3 for m in px4.of("MISSION_ITEM_REACHED")), 30.0, watch=watch)
    assert slowest[0] > 4.0


def test_upload_of_packed_parameters_is_not_emulated(px4: Stand) -> None:
    """test_param_ftp.cpp, "Parameters upload via MAVLink FTP": refused, as every write."""
    refused = Ftp(px4).ask(CREATE, b"@PARAM/param.pck")
    assert (refused.said, refused.data) == (NAK, b"\x09")


@pytest.mark.parametrize("unit", ["gps", "mag", "baro"])
def test_sensor_lost_during_a_mission(px4: Stand, unit: str) -> None:
    """test_multicopter_failsafe.cpp, "Land on GPS lost …": disarmed in 30 s; the others go on."""
    px4.set_parameter("SYS_FAILURE_EN", 1)
    px4.fly_mission([*SQUARE, Way(RTL, frame=2)])
    px4.until(lambda: px4.last("MISSION_CURRENT").seq >= 2, 60.0)
    code = {"gps": 4, "mag": 2, "baro": 3}[unit]
    result = px4.command(FAIL, code, 1, 0)
    if unit == "gps":
        assert result == 0
        px4.until_disarmed(30.0)
    else:
        # Compass and barometer are not simulated, so their failure is refused.
        assert result == 3
        px4.until_disarmed(180.0)


def test_reposition_reaches_and_holds(px4: Stand) -> None:
    """test_multicopter_goto.cpp, "Goto: reposition … flies to and holds at the target"."""
    px4.take_off(10.0)
    assert reposition(px4, 50.0, 0.0, 10.0) == 0
    px4.until(lambda: math.dist(px4.position[:2], (50.0, 0.0)) < 2.0, 60.0)
    px4.stays(lambda: math.dist(px4.position[:2], (50.0, 0.0)) < 2.0, 10.0)


def test_hold_in_the_middle_of_a_reposition(px4: Stand) -> None:
    """test_multicopter_goto.cpp, "Goto: pausing mid-reposition …": within 15 m, never back."""
    px4.take_off(10.0)
    hold = px4.position
    assert reposition(px4, 200.0, 0.0, 10.0) == 0
    px4.wait(3.0)
    pause = px4.position
    assert px4.command(REPOSITION_HERE, -1, 1, 0, NAN, NAN, NAN, NAN) == 0
    far = math.dist(pause[:2], hold[:2])
    px4.stays(lambda: math.dist(px4.position[:2], hold[:2]) > far - 2.0, 10.0)
    px4.stays(lambda: math.dist(px4.position[:2], pause[:2]) < 15.0, 5.0)


def test_speed_change_in_flight(px4: Stand) -> None:
    """test_multicopter_goto.cpp, "Goto: speed change while flying is applied": 2 + 0.5 m/s."""
    px4.take_off(10.0)
    assert reposition(px4, 200.0, 0.0, 10.0) == 0
    px4.wait(5.0)
    assert px4.command(SPEED, 1, 2.0, -1) == 0
    px4.wait(4.0)
    px4.stays(lambda: px4.speed < 2.5, 5.0)
