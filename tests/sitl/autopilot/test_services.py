"""What an outside client asks and is told: versions, streams, home, files, battery, GPS, failures."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as dialect

from sitl.vehicle.battery import BatteryConfig
from tests.sitl.autopilot_rig import ARM, FLAVOURS, SITE, TAKEOFF, Rig
from tests.sitl.outside_client import Client, only

GET_HOME, GET_INTERVAL, SET_INTERVAL, REQUEST, CAPABILITIES, SET_HOME, FAIL = (
    410,
    510,
    511,
    512,
    520,
    179,
    420,
)
ALL_STREAM, EXTRA1, POSITION = 0, 10, 6


def up(flavour: str, **changes: object) -> Client:
    client = Client(Rig(flavour, **changes))
    client.wait(1.2)
    return client


@pytest.mark.parametrize("command", [(CAPABILITIES, 1), (REQUEST, 148)])
@pytest.mark.parametrize(("flavour", "version"), [("ardupilot", (4, 6, 3, 255)), ("px4", (1, 16, 1, 255))])
def test_versions_are_those_of_the_real_ones(flavour, version, command):
    client = up(flavour)
    assert client.command(*command) == 0
    (message,) = client.of("AUTOPILOT_VERSION")
    assert tuple(message.flight_sw_version.to_bytes(4, "big")) == version
    has = {
        name: bool(message.capabilities & getattr(dialect, f"MAV_PROTOCOL_CAPABILITY_{name}"))
        for name in (
            "MAVLINK2",
            "MISSION_INT",
            "COMMAND_INT",
            "PARAM_ENCODE_BYTEWISE",
            "FTP",
            "MISSION_FENCE",
        )
    }
    assert has == {
        "MAVLINK2": True,
        "MISSION_INT": True,
        "COMMAND_INT": True,
        "PARAM_ENCODE_BYTEWISE": flavour == "px4",
        "FTP": True,
        "MISSION_FENCE": True,
    }
    assert message.uid != 0


def test_vehicles_have_uids_of_their_own():
    uids = set()
    for system in (11, 12):
        client = Client(Rig(system_id=system))
        client.send(dialect.MAVLink_command_long_message(system, 1, CAPABILITIES, 0, 1, 0, 0, 0, 0, 0, 0))
        uids.add(client.of("AUTOPILOT_VERSION")[0].uid)
    assert len(uids) == 2


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_intervals_are_told_as_they_were_set(flavour):
    client = up(flavour)
    for asked, told in ((100_000, 100_000), (-1, -1), (0, 20_000)):
        assert client.command(SET_INTERVAL, 30, asked) == 0
        assert client.command(GET_INTERVAL, 30) == 0
        answer = client.of("MESSAGE_INTERVAL")[-1]
        assert (answer.message_id, answer.interval_us) == (30, told)
    assert client.command(GET_INTERVAL, 9999) == 0
    assert client.of("MESSAGE_INTERVAL")[-1].interval_us == 0
    assert client.command(GET_INTERVAL, -4) == 2


@pytest.mark.parametrize("message_id", [2, 24, 31, 42, 74, 148, 242])
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_each_message_comes_on_request_and_at_a_rate(flavour, message_id):
    client = up(flavour)
    name = dialect.mavlink_map[message_id].msgname
    assert not client.of(name)
    assert client.command(REQUEST, message_id) == 0
    assert len(client.of(name)) == 1
    assert client.command(SET_INTERVAL, message_id, 100_000) == 0
    client.wait(1.0)
    assert len(client.of(name)) == 11


def test_data_streams_set_the_rate_of_a_group_in_ardupilot_alone():
    def ask(stream, rate, start=1):
        return dialect.MAVLink_request_data_stream_message(11, 1, stream, rate, start)

    ap, px = up("ardupilot"), up("px4")
    for client, counts in ((ap, (4, 20)), (px, (50, 50))):
        for rate, start, total in ((4, 1, counts[0]), (20, 1, counts[1])):
            client.send(ask(EXTRA1, rate, start))
            client.received.clear()
            client.wait(1.0)
            assert len(client.of("ATTITUDE")) == total
    ap.send(ask(ALL_STREAM, 4, 0))
    ap.received.clear()
    ap.wait(1.0)
    assert {m.get_type() for m in ap.received} <= {
        "HEARTBEAT",
        "POSITION_TARGET_LOCAL_NED",
        "EXTENDED_SYS_STATE",
    }
    ap.send(ask(ALL_STREAM, 1000))
    ap.received.clear()
    ap.wait(0.2)
    assert ap.of("VFR_HUD")


def test_ardupilots_sr0_parameters_are_rates():
    client = up("ardupilot")
    client.send(dialect.MAVLink_param_set_message(11, 1, b"SR0_EXTRA2", 5.0, 4))
    client.wait(2.0)
    assert len(client.of("VFR_HUD")) == 10


NORMAL = {
    "HEARTBEAT",
    "SYS_STATUS",
    "EXTENDED_SYS_STATE",
    "BATTERY_STATUS",
    "GPS_RAW_INT",
    "VFR_HUD",
    "ATTITUDE",
    "LOCAL_POSITION_NED",
    "GLOBAL_POSITION_INT",
    "HOME_POSITION",
    "SYSTEM_TIME",
    "MISSION_CURRENT",
}


def test_px4_streams_what_ground_stations_live_on():
    client = Client(Rig("px4", streams="normal", battery=BatteryConfig()))
    client.wait(5.0)
    received = {m.get_type() for m in client.received}
    assert received >= NORMAL | {"ESTIMATOR_STATUS", "ALTITUDE"}
    assert "EKF_STATUS_REPORT" not in received


def test_ardupilot_streams_nothing_unasked_and_all_of_its_groups_when_asked():
    """SRn_ are 0 by default; 0 of SET_MESSAGE_INTERVAL restores this."""
    client = Client(Rig("ardupilot", streams="normal", battery=BatteryConfig()))
    client.wait(3.0)
    unasked = {"HEARTBEAT", "STATUSTEXT", "TIMESYNC"}
    assert {m.get_type() for m in client.received} <= unasked | {"HOME_POSITION", "GPS_GLOBAL_ORIGIN"}
    for message_id in (1, 33):
        assert client.command(SET_INTERVAL, message_id, 0) == 0
    assert {m.get_type() for m in client.wait(3.0)} <= unasked
    client.send(dialect.MAVLink_request_data_stream_message(11, 1, 0, 4, 1))
    received = {m.get_type() for m in client.wait(2.0)}
    assert received >= NORMAL - {"EXTENDED_SYS_STATE", "HOME_POSITION", "ATTITUDE_QUATERNION"}
    assert "EKF_STATUS_REPORT" in received
    assert not received & {"ESTIMATOR_STATUS", "ALTITUDE"}


def test_no_fence_is_breached():
    client = Client(Rig("ardupilot", streams="normal"))
    client.send(dialect.MAVLink_request_data_stream_message(11, 1, 0, 4, 1))
    client.wait(2.0)
    assert client.of("SYS_STATUS")
    assert all(m.onboard_control_sensors_health & 0x100000 for m in client.of("SYS_STATUS"))


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_quiet_ones_say_no_more_than_before(flavour):
    client = Client(Rig(flavour))
    client.wait(5.0)
    assert not {m.get_type() for m in client.received} & (
        NORMAL
        - {
            "HEARTBEAT",
            "SYS_STATUS",
            "EXTENDED_SYS_STATE",
            "ATTITUDE",
            "LOCAL_POSITION_NED",
            "GLOBAL_POSITION_INT",
        }
    )
    status = client.of("SYS_STATUS")[-1]
    assert (status.voltage_battery, status.battery_remaining) == (0xFFFF, -1)


# Home


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_home_is_the_start_until_it_is_moved(flavour):
    client = up(flavour)
    assert client.command(GET_HOME) == 0
    home = client.of("HOME_POSITION")[-1]
    assert (home.latitude, home.longitude, home.altitude) == (473977420, 85455940, 488000)
    assert (home.x, home.y, home.z) == (0, 0, 0)
    latitude, longitude, altitude = SITE.to_geodetic((4.0, 3.0, 2.0))
    x, y = round(latitude * 1e7), round(longitude * 1e7)
    message = dialect.MAVLink_command_int_message(11, 1, 0, SET_HOME, 0, 0, 0, 0, 0, 0, x, y, altitude)
    found = client.send(message)
    home = only(found, "HOME_POSITION")
    assert only(found, "COMMAND_ACK").result == 0
    assert (home.latitude, home.longitude) == (x, y)
    np.testing.assert_allclose((home.x, home.y, home.z), (3.0, 4.0, -2.0), atol=0.02)
    client.wait(0.2)
    assert client.of("GLOBAL_POSITION_INT")[-1].relative_alt == pytest.approx(-2000, abs=2)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_home_is_set_here_by_message_and_not_in_nonsense(flavour):
    client = Client(Rig(flavour).hover(5.0))
    assert client.command(SET_HOME, 1) == 0
    assert client.of("HOME_POSITION")[-1].z == pytest.approx(-5.0, abs=0.1)
    nan = [math.nan] * 4
    for latitude, ok in ((473977500, True), (0, False)):
        seen = len(client.of("HOME_POSITION"))
        client.send(
            dialect.MAVLink_set_home_position_message(11, latitude, 85455940, 488000, 0, 0, 0, nan, 0, 0, 0)
        )
        assert len(client.of("HOME_POSITION")) == seen + ok
    assert client.texts[-1] == "Home refused: more than 100 km from here"
    assert client.command(SET_HOME, 0, 0, 0, 0, 91.0, 0.0, 0.0) == 2
    assert client.command(SET_HOME, 0, 0, 0, 0, math.nan, 0.0, 0.0) == 2


def test_an_origin_that_is_set_stays_and_is_told():
    client = up("ardupilot")
    before = len(client.of("GPS_GLOBAL_ORIGIN"))
    client.send(dialect.MAVLink_set_gps_global_origin_message(11, 470000000, 80000000, 0))
    assert len(client.of("GPS_GLOBAL_ORIGIN")) == before + 1
    assert client.of("GPS_GLOBAL_ORIGIN")[-1].latitude == 473977420
    assert client.texts[-1] == "Origin refused: it is set already"


def test_a_takeoff_counts_from_home():
    client = up("ardupilot")
    latitude, longitude, altitude = SITE.to_geodetic((0.0, 0.0, 3.0))
    client.command(SET_HOME, 0, 0, 0, 0, latitude, longitude, altitude)
    client.command(176, 1, 4)
    client.command(ARM, 1)
    assert client.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 4) == 0
    client.wait(10.0)
    assert client.rig.position[2] == pytest.approx(-7.0, abs=0.1)


# Files


def ftp(opcode: int, path: bytes = b"", session: int = 0) -> bytes:
    head = struct.pack("<HBBBBBxI", 41, session, opcode, len(path), 0, 0, 0)
    return (head + path).ljust(251, b"\0")


@pytest.mark.parametrize(
    ("opcode", "answer", "error"),
    [(4, 129, 10), (3, 129, 10), (15, 129, 4), (6, 129, 9), (99, 129, 7), (1, 128, 0), (2, 128, 0)],
)
def test_what_is_not_there_is_refused_at_once(opcode, answer, error):
    client = up("ardupilot")
    found = client.send(
        dialect.MAVLink_file_transfer_protocol_message(0, 11, 1, ftp(opcode, b"absent/param.pck"))
    )
    reply = only(found, "FILE_TRANSFER_PROTOCOL")
    assert (reply.target_system, reply.target_component) == (255, 190)
    sequence, _, said, size, asked, _, _ = struct.unpack("<HBBBBBxI", bytes(reply.payload[:12]))
    assert (sequence, said, asked) == (42, answer, opcode)
    assert (size, reply.payload[12]) == ((1, error) if answer == 129 else (0, 0))


def test_an_answer_about_files_is_not_answered():
    client = up("px4")
    client.send(dialect.MAVLink_file_transfer_protocol_message(0, 11, 1, ftp(129)))
    assert not client.of("FILE_TRANSFER_PROTOCOL")


# Battery, GPS, failures


def test_a_battery_drains_as_it_flies_and_its_messages_agree():
    battery = BatteryConfig(cells=3, capacity_mah=300.0, hover_current=20.0)
    client = Client(Rig("px4", streams="normal", battery=battery).hover(5.0))
    assert client.command(REQUEST, 147) == 0
    first = client.of("BATTERY_STATUS")[-1]
    client.wait(20.0)
    for message_id in (147, 1):
        assert client.command(REQUEST, message_id) == 0
    last, status = client.of("BATTERY_STATUS")[-1], client.of("SYS_STATUS")[-1]
    assert first.battery_remaining - last.battery_remaining == pytest.approx(20 * 20.5 / 3.6 / 3.0, abs=2)
    assert last.current_battery == pytest.approx(2050, abs=20)
    assert last.current_consumed == pytest.approx(300 * (1 - last.battery_remaining / 100), abs=4)
    assert abs(last.voltages[0] - status.voltage_battery) < 40
    assert first.voltages[0] > last.voltages[0]
    assert list(last.voltages[1:]) == [0xFFFF] * 9
    assert abs(status.battery_remaining - last.battery_remaining) <= 1


def test_gps_and_filter_come_up_in_stages():
    client = Client(Rig("ardupilot", streams="normal", ready_after=9.0, startup="in stages"))
    client.send(dialect.MAVLink_request_data_stream_message(11, 1, 0, 4, 1))
    client.wait(10.0)
    fixes = [m.fix_type for m in client.of("GPS_RAW_INT")]
    assert fixes == sorted(fixes)
    assert set(fixes) == {1, 2, 3}
    flags = list(dict.fromkeys(m.flags for m in client.of("EKF_STATUS_REPORT")))
    assert len(flags) == 4
    assert not flags[-2] & 0x10
    assert flags[-1] & 0x10
    assert client.command(ARM, 0) == 0


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_position_is_told_alike_by_all_messages(flavour):
    client = Client(Rig(flavour, streams="normal").hover(5.0))
    client.wait(1.0)
    client.received.clear()
    for message_id in (24, 33, 74, 31, 30):
        client.command(REQUEST, message_id)
    gps, place, hud = (client.of(n)[-1] for n in ("GPS_RAW_INT", "GLOBAL_POSITION_INT", "VFR_HUD"))
    assert (gps.fix_type, gps.lat, gps.lon) == (
        3,
        pytest.approx(place.lat, abs=3),
        pytest.approx(place.lon, abs=3),
    )
    assert gps.alt == pytest.approx(place.alt, abs=20)
    assert hud.alt == pytest.approx(place.alt / 1e3, abs=0.02)
    assert 45 < hud.throttle < 55
    q, e = client.of("ATTITUDE_QUATERNION")[-1], client.of("ATTITUDE")[-1]
    assert math.atan2(2 * (q.q1 * q.q4 + q.q2 * q.q3), 1 - 2 * (q.q3**2 + q.q4**2)) == pytest.approx(
        e.yaw, abs=1e-5
    )
    assert math.hypot(q.q1, q.q2, q.q3, q.q4) == pytest.approx(1.0)


def test_failures_need_leave_and_then_happen():
    client = Client(Rig("px4", battery=BatteryConfig()).hover(5.0))
    assert client.command(FAIL, 4, 1, 0) == 2
    one = struct.unpack("<f", struct.pack("<i", 1))[0]
    client.send(dialect.MAVLink_param_set_message(11, 1, b"SYS_FAILURE_EN", one, 6))
    assert client.command(FAIL, 100, 1, 0) == 0
    client.wait(1.1)
    assert client.of("SYS_STATUS")[-1].battery_remaining == 0
    assert client.command(FAIL, 101, 1, 9) == 2
    assert client.command(FAIL, 101, 1, 2) == 0
    client.wait(3.0)
    assert client.rig.autopilot.state.rotor_speeds[1] == 0.0
    assert client.command(FAIL, 101, 0, 2) == 0
    assert client.command(FAIL, 4, 1, 0) == 0
    client.wait(8.0)
    assert not client.of("SYS_STATUS")[-1].onboard_control_sensors_health & 0x20
    assert client.command(FAIL, 4, 0, 0) == 0
    client.wait(2.0)
    assert client.of("SYS_STATUS")[-1].onboard_control_sensors_health & 0x20
    assert client.command(FAIL, 0, 1, 0) == 3


@pytest.mark.parametrize(
    ("flavour", "custom", "command"), [("ardupilot", 4, 11), ("px4", 4 << 16 | 3 << 24, 176)]
)
def test_set_mode_as_a_message(flavour, custom, command):
    client = up(flavour)
    found = client.send(dialect.MAVLink_set_mode_message(11, 1, custom))
    assert [(m.command, m.result) for m in found if m.get_type() == "COMMAND_ACK"] == [(command, 0)]
    client.wait(1.0)
    assert client.of("HEARTBEAT")[-1].custom_mode == custom


def test_unknown_commands_are_unsupported_and_explained():
    client = up("ardupilot")
    assert client.command(31_337) == 3
    assert client.texts[-1] == "Command 31337 is not supported"


@settings(max_examples=60, deadline=None)
@given(
    calls=st.lists(
        st.tuples(
            st.sampled_from((20, 179, 224, 245, 300, 410, 420, 510, 511, 512, 520)),
            st.tuples(*[st.floats(width=32) | st.sampled_from((0.0, 1.0, -1.0, 2.0, 4.0, 101.0))] * 7),
        ),
        max_size=12,
    ),
    flavour=st.sampled_from(FLAVOURS),
)
def test_no_parameter_of_a_command_upsets_it(calls, flavour):
    client = Client(Rig(flavour, start_height=5.0, failures="refused"))
    client.wait(0.1)
    for command, params in calls:
        client.send(dialect.MAVLink_command_long_message(11, 1, command, 0, *params))
        assert client.of("COMMAND_ACK")[-1].command == command
    client.wait(0.3)
    assert np.isfinite(client.rig.position).all()


@pytest.mark.parametrize("instance", [0.5, 1.5, -1.0, 7.0, math.nan, math.inf])
def test_a_motor_that_does_not_exist_cannot_be_stopped(instance):
    """FAILURE_UNIT_SYSTEM_MOTOR (101), FAILURE_TYPE_OFF (1)."""
    client = up("px4", failures="obeyed")
    assert client.command(420, 101, 1, instance) == 2
    assert client.command(420, 101, 1, 1) == 0


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_no_client_switches_the_heartbeat_of_all_off(flavour):
    client = up(flavour, streams="normal")
    for interval in (-1, 1_000_001, 1e9):
        assert client.command(SET_INTERVAL, 0, interval) == 2
    assert client.command(SET_INTERVAL, 0, 500_000) == 0
    assert client.command(SET_INTERVAL, 0, 0) == 0
    beats = [m for m in client.wait(5.0) if m.get_type() == "HEARTBEAT"]
    assert len(beats) in (4, 5, 6)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_what_a_client_polls_for_in_vain_is_mentioned_once(flavour):
    """As MAVSDK polls for a camera: each request is answered, and one text says why."""
    client = up(flavour)
    said = []
    for _ in range(10):
        found = client.send(dialect.MAVLink_command_long_message(11, 1, REQUEST, 0, 259, 0, 0, 0, 0, 0, 0))
        assert [m.result for m in found if m.get_type() == "COMMAND_ACK"] == [3]
        found += client.wait(1.5)
        said += [m.text for m in found if m.get_type() == "STATUSTEXT" and "259" in m.text]
    assert len(said) == 1
