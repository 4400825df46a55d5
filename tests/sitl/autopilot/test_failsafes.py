"""What a vehicle does by itself: at its fence, and when its battery is low."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as dialect
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import FenceStatus, RequestDataStream, SysStatus
from sitl.autopilot.fences import Breach, Fences, Rules
from sitl.autopilot.firmware import Mode
from sitl.autopilot.missions.items import Item
from sitl.autopilot.missions.plans import Plans
from sitl.config.autopilot import AutopilotConfig
from sitl.values.home import Home
from sitl.values.origin import Origin
from tests.sitl.autopilot_rig import ARM, FLAVOURS, PILOT, SITE, VELOCITY_YAW, Rig, setpoint
from tests.sitl.mission_client import Way, at, upload
from tests.sitl.outside_client import Client

ACCEPTED, FAILED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED
REQUEST, FENCE_STATUS = 512, 162
STAY_IN, STAY_OUT, CIRCLE_IN, CIRCLE_OUT = 5001, 5002, 5003, 5004
FENCE = 1
PREARM, GEOFENCE = 0x10000000, 0x100000
NORTH = setpoint(VELOCITY_YAW, velocity=(3.0, 0.0, 0.0))
SQUARE = [(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)]
OPEN = Rules(True, True, math.inf, math.inf, "hold")


def polygon(corners, command=STAY_IN):
    return [at(x, y, 0.0, command, float(len(corners))) for x, y in corners]


def fences(*ways: Way) -> Fences:
    items = tuple(Item(w.frame, w.command, 1, w.params, w.x, w.y, w.z) for w in ways)
    origin = Origin(SITE, SITE.latitude, SITE.longitude, SITE.altitude)
    return Fences(Plans(((), items, ())), origin, Home(origin))


def fenced(flavour, **settings_):
    """Flying, within a square of 40 m."""
    fence = {"enabled": "on", **settings_}
    rig = Rig(flavour, fence=fence, streams="normal").hover(5.0)
    assert upload(Client(rig), polygon(SQUARE), FENCE) == 0
    return rig


STATUS = RequestDataStream(PILOT, 2, 11, 1, mavlink.MAV_DATA_STREAM_EXTENDED_STATUS, 1)
ACTIONS = {"hold": Mode.HOLD, "return": Mode.RETURN, "land": Mode.LAND}


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("action", ACTIONS)
def test_at_the_fence_it_does_what_is_set(flavour, action):
    rig = fenced(flavour, action=action)
    rig.step(NORTH)
    assert rig.guided() == [ACCEPTED]
    for _ in range(200):
        rig.run(0.05, NORTH)
        if rig.autopilot.mode is not Mode.GUIDED:
            break
    assert rig.autopilot.mode is ACTIONS[action]
    # At 3 m/s, looked at ten times a second.
    assert 20.0 <= rig.position[0] < 20.5
    assert "Fence breached: outside" in rig.texts
    rig.order(REQUEST, FENCE_STATUS)
    (status,) = rig.all(FenceStatus)
    assert (status.breached, status.breaches, status.kind) == (True, 1, Breach.BOUNDARY)


def test_a_fence_that_is_off_or_only_warns_changes_nothing():
    for settings_ in ({"enabled": "off"}, {"action": "warn"}, {"action": "nothing"}):
        rig = fenced("ardupilot", **settings_)
        rig.run(9.0, NORTH)
        assert rig.autopilot.mode is Mode.GUIDED
        assert rig.position[0] > 21.0
        warned = any(text.startswith("Fence") for text in rig.texts)
        assert warned is (settings_.get("action") == "warn")


def test_beyond_its_fence_it_is_not_armed_and_says_so():
    rig = Rig("ardupilot", fence={"enabled": "on"}, streams="normal")
    rig.step(STATUS)
    rig.run(1.1)
    elsewhere = [(x + 100.0, y) for x, y in SQUARE]
    assert upload(Client(rig), polygon(elsewhere), FENCE) == 0
    rig.run(1.0)
    assert not rig.all(SysStatus)[-1].health & PREARM
    assert rig.guided() == [ACCEPTED]
    assert rig.order(ARM, 1) == [FAILED]
    assert "Arming refused: outside of the fence" in rig.texts
    assert rig.order(ARM, 1, 21196) == [ACCEPTED]
    # It says it again by itself.
    rig.received.clear()
    rig.order(ARM, 0)
    rig.run(61.0)
    assert rig.texts.count("PreArm: outside of the fence") == 2


def test_the_cylinder_around_home_counts_too():
    rig = Rig("px4", fence={"height": 10.0, "radius": 15.0, "action": "return"}).hover(5.0)
    up = setpoint(VELOCITY_YAW, velocity=(0.0, 0.0, -1.0))
    rig.step(up)
    assert rig.guided() == [ACCEPTED]
    rig.run(6.0, up)
    assert rig.autopilot.mode is Mode.RETURN
    assert "Fence breached: too high" in rig.texts


def test_a_breach_is_seen_in_sys_status_and_mavproxy_sees_none_without_one():
    rig = fenced("ardupilot", action="hold")
    rig.step(STATUS)
    rig.run(1.0)
    assert rig.all(SysStatus)[-1].health & GEOFENCE
    rig.run(9.0, NORTH)
    assert not rig.all(SysStatus)[-1].health & GEOFENCE


metres = st.floats(-60.0, 60.0)


@given(x=metres, y=metres)
@settings(max_examples=200, deadline=None)
def test_areas_keep_in_and_out(x, y):
    if min(abs(abs(x) - 20.0), abs(abs(y) - 20.0)) < 0.05 or abs(math.hypot(x, y) - 30.0) < 0.05:
        return
    inside = max(abs(x), abs(y)) < 20.0
    for command, breached in ((STAY_IN, not inside), (STAY_OUT, inside)):
        found = fences(*polygon(SQUARE, command)).breach((x, y, -5.0), OPEN)
        assert found is (Breach.BOUNDARY if breached else Breach.NONE)
        other_way = fences(*polygon(SQUARE[::-1], command)).breach((x, y, -5.0), OPEN)
        assert other_way is found
    near = math.hypot(x, y) < 30.0
    for command, breached in ((CIRCLE_IN, not near), (CIRCLE_OUT, near)):
        found = fences(at(0.0, 0.0, 0.0, command, 30.0)).breach((x, y, -5.0), OPEN)
        assert found is (Breach.BOUNDARY if breached else Breach.NONE)


def test_one_of_several_areas_is_enough_for_px4_and_all_are_needed_for_ardupilot():
    east = [(x, y + 60.0) for x, y in SQUARE]
    two = fences(*polygon(SQUARE), *polygon(east))
    assert two.breach((0.0, 0.0, -5.0), OPEN) is Breach.NONE
    assert two.breach((0.0, 0.0, -5.0), OPEN._replace(any_area=False)) is Breach.BOUNDARY
    assert two.breach((0.0, 30.0, -5.0), OPEN) is Breach.BOUNDARY


# Batteries

SMALL = {"capacity_mah": 100.0, "hover_current": 20.0}


@pytest.mark.parametrize(("action", "mode"), [("warn", None), ("return", Mode.RETURN), ("land", Mode.LAND)])
def test_px4_returns_or_lands_when_its_battery_is_critical(action, mode):
    battery = {"capacity_mah": 300.0, "remaining": 0.35}
    rates = {"sys_status": 10.0}
    rig = Rig("px4", battery=battery, battery_failsafe={"action": action}, rates=rates).hover(5.0)
    said = []
    while not said or said[-1][0] > 0.05:
        rig.run(0.1)
        said.append((rig.all(SysStatus)[-1].battery_remaining, rig.autopilot.mode))
    assert [text[:16] for text in rig.texts if "attery" in text] == ["Battery low: 13.", "Battery critical"]
    # What is told is rounded to a hundredth.
    assert {m for left, m in said if left < 0.065} == {mode or Mode.HOLD}
    assert {m for left, m in said if left > 0.075} == {Mode.HOLD}


def test_an_arducopter_goes_by_voltage_and_waits_ten_seconds():
    battery = {"capacity_mah": 1000.0, "remaining": 0.9}
    failsafe = {"low_voltage": 15.6, "low_action": "land"}
    rig = Rig("ardupilot", battery=battery, battery_failsafe=failsafe).hover(5.0)
    below_at = None
    for k in range(1200):
        rig.run(0.1)
        voltage = rig.all(SysStatus)[-1].battery_voltage
        if voltage < 15.6 and below_at is None:
            below_at = k
        if rig.autopilot.mode is Mode.LAND:
            break
    # SYS_STATUS comes once a second.
    assert below_at is not None
    assert 8.5 <= 0.1 * (k - below_at) <= 11.0
    rig.run(20.0)
    assert not rig.autopilot.armed
    assert np.linalg.norm(rig.position[:2]) < 0.2


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_with_an_empty_battery_the_motors_stop(flavour):
    rig = Rig(flavour, battery={**SMALL, "remaining": 0.75}).hover(5.0)
    rig.run(10.0)
    assert not rig.autopilot.armed
    assert "Battery empty: motors stopped" in rig.texts
    assert -rig.position[2] < 0.2
    rig.received.clear()
    rig.order(ARM, 1)
    assert not rig.autopilot.armed


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_low_battery_speaks_against_arming(flavour):
    failsafe = {"low_voltage": 15.0}
    rig = Rig(flavour, battery={"remaining": 0.1}, battery_failsafe=failsafe)
    rig.run(12.0)
    assert rig.order(ARM, 1) == [FAILED]
    assert "Arming refused: battery low" in rig.texts
    assert not rig.all(SysStatus)[-1].health & PREARM


def test_the_settings_of_a_vehicle_without_any_of_this_are_as_before():
    config = AutopilotConfig(system_id=1, latitude=0.0, longitude=0.0)
    assert config.battery is None
    assert config.fence.enabled == "off"
    assert config.follow.enabled == "off"


def test_a_fence_does_not_end_the_landing_that_a_battery_began():
    battery = {"capacity_mah": 300.0, "remaining": 0.3}
    rig = Rig(
        "px4", battery=battery, battery_failsafe={"action": "land"}, fence={"height": 12.0, "action": "hold"}
    ).hover(10.0)
    while rig.autopilot.mode is not Mode.LAND:
        rig.run(0.1)
    rig.autopilot.shift_gps((0.0, 0.0, 5.0))
    rig.run(12.0)
    assert rig.autopilot.mode is not Mode.HOLD or not rig.autopilot.armed


def test_kinds_of_fences_count_as_fence_type_says():
    rig = fenced("ardupilot", action="hold", kinds=1.0)
    rig.run(9.0, NORTH)
    assert rig.position[0] > 21.0
    assert rig.order(207, 0) == [ACCEPTED]
    assert rig.order(207, 2) == [2]


def test_worries_that_are_over_on_the_ground_are_forgotten():
    failsafe = {"low_voltage": 17.0}
    rig = Rig("ardupilot", battery={"remaining": 1.0}, battery_failsafe=failsafe)
    rig.run(12.0)
    assert rig.guided() == [ACCEPTED]
    assert rig.order(ARM, 1) == [FAILED]
    Client(rig).send(dialect.MAVLink_param_set_message(11, 1, b"BATT_LOW_VOLT".ljust(16, b"\0"), 10.5, 9))
    rig.run(0.5)
    assert rig.order(ARM, 1) == [ACCEPTED]
