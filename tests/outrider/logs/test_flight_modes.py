"""Names of flight modes, against pymavlink's and from HEARTBEATs."""

from __future__ import annotations

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import Heartbeat, Source
from outrider.logs.flight_modes import mode_name, mode_of, reported_mode

PX4_WORDS = {
    "LOITER": "AUTO HOLD",
    "MISSION": "AUTO MISSION",
    "RTL": "AUTO RETURN",
    "LAND": "AUTO LAND",
    "FOLLOWME": "AUTO FOLLOW",
    "TAKEOFF": "AUTO TAKEOFF",
}
RETIRED = {"RTGS", "POSITION", "OF_LOITER"}
"""Modes that no supported firmware has."""


def beat(custom: int, autopilot: int, kind: int = mavlink.MAV_TYPE_HEXAROTOR, base: int = 0) -> Heartbeat:
    return Heartbeat(Source(11, 1), kind, autopilot, base, custom, mavlink.MAV_STATE_ACTIVE)


@pytest.mark.parametrize(("name", "numbers"), mavutil.px4_map.items())
def test_the_modes_of_px4_have_the_numbers_that_pymavlink_gives_them(name, numbers) -> None:
    _, main, sub = numbers
    if name not in RETIRED:
        assert mode_name("px4", main << 16 | sub << 24) == PX4_WORDS.get(name, name)


@pytest.mark.parametrize(("number", "name"), mavutil.mode_mapping_acm.items())
def test_the_modes_of_arducopter_have_the_names_that_pymavlink_gives_them(number, name) -> None:
    if name not in RETIRED:
        assert mode_name("ardupilot", number) in (name, str(number))


@pytest.mark.parametrize(
    ("flavour", "number", "name"),
    [
        ("ardupilot", 0, "STABILIZE"),
        ("ardupilot", 4, "GUIDED"),
        ("ardupilot", 99, "99"),
        ("px4", 4 << 16 | 9 << 24, "AUTO PRECLAND"),
        ("px4", 3 << 16 | 1 << 24, "POSCTL ORBIT"),
        ("px4", 4 << 16 | 77 << 24, "4.77"),
        ("px4", 99 << 16, "99.0"),
    ],
)
def test_a_mode_without_a_name_is_its_number(flavour: str, number: int, name: str) -> None:
    assert mode_name(flavour, number) == name


@pytest.mark.parametrize(
    ("heartbeat", "name"),
    [
        (beat(6 << 16, mavlink.MAV_AUTOPILOT_PX4), "OFFBOARD"),
        (beat(9, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA), "LAND"),
        # A plane's GUIDED is 15, which is a copter's AUTOTUNE.
        (beat(15, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_FIXED_WING), "15"),
        (beat(4, mavlink.MAV_AUTOPILOT_GENERIC), "4"),
    ],
)
def test_a_heartbeat_tells_whose_mode_it_is(heartbeat: Heartbeat, name: str) -> None:
    assert mode_of(heartbeat) == name
    armed = heartbeat._replace(base_mode=mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
    assert (reported_mode(heartbeat), reported_mode(armed)) == (f"{name}, disarmed", name)
