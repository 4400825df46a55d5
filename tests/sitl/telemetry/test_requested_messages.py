"""Messages that clients ask for: which firmware has which, and that they agree with one another."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import all as dialect

from tests.sitl.autopilot_rig import FLAVOURS, INTERVAL, REQUEST, Rig
from tests.sitl.outside_client import Client

ACCEPTED, DENIED, UNSUPPORTED = 0, 2, 3
# Sources: the streams of PX4 1.16 and the table of messages of ArduPilot 4.6; recordings of both.
BOTH = (26, 29, 36)
PX4 = (141, 230, 264, 331, 340, 375, 436, 437)
ARDUPILOT = (27, 193, 437)
ANSWERS = {
    "ardupilot": {
        **dict.fromkeys((*BOTH, *ARDUPILOT), ACCEPTED),
        65: DENIED,
        125: DENIED,
        **dict.fromkeys((141, 230, 264, 331, 340, 375, 397, 436), UNSUPPORTED),
    },
    "px4": {
        **dict.fromkeys((*BOTH, *PX4), ACCEPTED),
        65: DENIED,
        **dict.fromkeys((27, 125, 193), UNSUPPORTED),
    },
}


def flying(flavour: str) -> Client:
    client = Client(
        Rig(flavour, tick=10_000, start_height=5.0, streams="normal", epoch=1_700_000_000_000_000)
    )
    client.wait(2.0)
    return client


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_each_firmware_gives_its_own_messages(flavour):
    client = flying(flavour)
    for message_id, result in ANSWERS[flavour].items():
        client.received.clear()
        assert client.command(REQUEST, message_id) == result, message_id
        # Its own streams go on; what it has not or knows nothing of never comes.
        kind = dialect.mavlink_map.get(message_id)
        if kind is not None and result == ACCEPTED:
            assert client.of(kind.msgname)
        elif kind is not None:
            client.wait(1.0)
            assert not client.of(kind.msgname)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_an_interval_makes_a_stream_of_each(flavour):
    client = flying(flavour)
    for message_id in (29, 36, 83):
        assert client.command(INTERVAL, message_id, 50_000) == 0
    client.received.clear()
    client.wait(1.0)
    for name in ("SCALED_PRESSURE", "SERVO_OUTPUT_RAW", "ATTITUDE_TARGET"):
        assert len(client.of(name)) in (20, 21)


def test_px4_streams_what_it_was_recorded_to_stream():
    client = flying("px4")
    client.received.clear()
    client.wait(10.0)
    for name, rate in (
        ("SERVO_OUTPUT_RAW", 10),
        ("ATTITUDE_TARGET", 10),
        ("SCALED_PRESSURE", 1),
        ("TIMESYNC", 10),
    ):
        assert len(client.of(name)) == pytest.approx(10 * rate, abs=1), name


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_timesync_is_asked_as_recorded_and_answered(flavour):
    client = flying(flavour)
    client.received.clear()
    client.wait(20.0)
    asked = [m for m in client.of("TIMESYNC") if m.tc1 == 0]
    assert len(asked) == pytest.approx({"ardupilot": 2, "px4": 200}[flavour], abs=1)
    # The recorded ArduPilot adds its system id to the nanoseconds.
    assert {m.ts1 % 1000 for m in asked} == {{"ardupilot": 11, "px4": 0}[flavour]}
    found = client.send(dialect.MAVLink_timesync_message(0, 12_345))
    (answer,) = [m for m in found if m.get_type() == "TIMESYNC" and m.tc1]
    assert answer.ts1 == 12_345
    assert not [
        m for m in client.send(dialect.MAVLink_timesync_message(7, 9)) if m.get_type() == "TIMESYNC" and m.tc1
    ]
    if flavour == "ardupilot":
        assert client.command(INTERVAL, 111, 100_000) == DENIED


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_the_modes_are_listed_one_by_one_and_all_at_once(flavour):
    client = flying(flavour)
    assert client.command(REQUEST, 435, 0) == 0
    modes = client.of("AVAILABLE_MODES")
    assert [m.mode_index for m in modes] == list(range(1, modes[0].number_modes + 1))
    assert len({m.custom_mode for m in modes}) == len(modes)
    assert client.of("HEARTBEAT")[-1].custom_mode in {m.custom_mode for m in modes}
    client.received.clear()
    assert client.command(REQUEST, 435, 2) == 0
    (one,) = client.of("AVAILABLE_MODES")
    assert (one.mode_index, one.mode_name) == (2, modes[1].mode_name)
    for absent in (len(modes) + 1, -1, 0.5, math.nan):
        assert client.command(REQUEST, 435, absent) == DENIED


def test_messages_about_one_motion_agree():
    client = flying("px4")
    for message_id in (30, 32, 33, 331, 340, 36, 375, 264):
        client.command(REQUEST, message_id)
    odometry, local = client.of("ODOMETRY")[-1], client.of("LOCAL_POSITION_NED")[-1]
    assert (odometry.x, odometry.y, odometry.z) == pytest.approx((local.x, local.y, local.z), abs=0.02)
    assert (odometry.frame_id, odometry.child_frame_id, odometry.estimator_type) == (1, 1, 8)
    assert math.isnan(odometry.pose_covariance[0])
    utm, place = client.of("UTM_GLOBAL_POSITION")[-1], client.of("GLOBAL_POSITION_INT")[-1]
    assert abs(utm.lat - place.lat) <= 2
    assert abs(utm.relative_alt - place.relative_alt) < 30
    assert utm.flight_state == dialect.UTM_FLIGHT_STATE_AIRBORNE
    servo, actuators = client.of("SERVO_OUTPUT_RAW")[-1], client.of("ACTUATOR_OUTPUT_STATUS")[-1]
    assert 1000 < servo.servo1_raw < 2000
    assert servo.servo7_raw == 0
    assert actuators.active == 0b111111
    assert actuators.actuator[0] == pytest.approx(servo.servo1_raw, abs=20)
    flight = client.of("FLIGHT_INFORMATION")[-1]
    # Since boot, in spite of the field's name.
    assert 0 < flight.takeoff_time_utc < 3_000_000


def test_the_attitude_target_is_what_the_vehicle_takes_up():
    client = flying("ardupilot")
    client.command(176, 1, 4)
    client.command(INTERVAL, 83, 20_000)
    client.command(INTERVAL, 31, 20_000)
    for _ in range(100):
        client.send(
            dialect.MAVLink_set_position_target_local_ned_message(
                0, 11, 1, 1, 0xC3F, 0, 0, 0, 0, 0, 0, 2.0, 0, 0, 0, 0
            )
        )
        client.wait(0.02)
    target, actual = client.of("ATTITUDE_TARGET")[-1], client.of("ATTITUDE_QUATERNION")[-1]
    pitch = [2 * math.asin(q[2]) for q in (target.q, (actual.q1, actual.q2, actual.q3, actual.q4))]
    assert pitch[0] == pytest.approx(-math.atan2(2.0, 9.81), abs=0.02)
    assert pitch[1] == pytest.approx(pitch[0], abs=0.1)
