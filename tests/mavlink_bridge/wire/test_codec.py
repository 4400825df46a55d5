"""Laws of the codec: what goes out comes back, with the values, units and texts of the messages."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from mavlink_bridge import messages as m
from mavlink_bridge.errors import EncodeError
from mavlink_bridge.messages import BY_ID, BY_TYPE
from mavlink_bridge.wire.codec import Codec
from tests.mavlink_bridge.message_values import (
    BEAT,
    KINDS,
    ME,
    POSITION,
    UNKNOWN_TO_PEER,
    any_message,
    known_message,
    wire,
)

# What version 1 leaves out reads as zero.
EXTENSIONS: dict[type[m.Message], dict[str, Any]] = {
    m.CommandAck: {"progress": 0, "result_param2": 0, "target_system": 0, "target_component": 0},
    m.GpsGlobalOrigin: {"time": 0},
    m.SetGpsGlobalOrigin: {"time": 0},
    m.HomePosition: {"time": 0},
    m.SetHomePosition: {"time": 0},
    m.MissionCurrent: {"total": 0, "state": 0, "mode": 0, "mission_id": 0, "fence_id": 0, "rally_id": 0},
    m.MissionCount: {"mission_type": 0, "opaque_id": 0},
    m.MissionAck: {"mission_type": 0, "opaque_id": 0},
    **{
        kind: {"mission_type": 0}
        for kind in (
            m.MissionWritePartialList,
            m.MissionItemFloat,
            m.MissionRequestFloat,
            m.MissionRequestList,
            m.MissionClearAll,
            m.MissionRequest,
            m.MissionItem,
        )
    },
    m.GpsRaw: {
        "altitude_ellipsoid": 0.0,
        "horizontal_accuracy": 0.0,
        "vertical_accuracy": 0.0,
        "speed_accuracy": 0.0,
    },
    m.BatteryStatus: {"time_remaining": 0, "charge_state": 0},
    m.AutopilotVersion: {"uid2": bytes(18)},
    m.FlightInformation: {"landed": 0},
}


ORIGIN = m.GpsGlobalOrigin(ME, 47.0, 8.0, 400.0, 5)


def test_every_message_has_one_row_and_one_strategy() -> None:
    assert set(BY_TYPE) == set(KINDS)
    assert len(BY_ID) == len(BY_TYPE)


@given(any_message)
def test_round_trip(message: m.Message) -> None:
    assert Codec().feed(wire(message)) == [message]


def in_floats(message: m.Message) -> m.Message:
    """What is left without extension fields: SIM_STATE's degrees as float32, eight of 16 outputs."""
    if isinstance(message, m.ServoOutput):
        return message._replace(outputs=message.outputs[:8] + (0,) * 8)
    if not isinstance(message, m.SimulationState):
        return message
    latitude, longitude = (
        round(float(np.float32(value)) * 1e7) / 1e7 for value in (message.latitude, message.longitude)
    )
    return message._replace(latitude=latitude, longitude=longitude)


@given(st.one_of(*(kind for of, kind in KINDS.items() if BY_TYPE[of].id < 256)))
def test_round_trip_in_version_1_keeps_all_but_extension_fields(message: m.Message) -> None:
    (back,) = Codec().feed(Codec().encode_v1(message))
    assert back == in_floats(message)._replace(**EXTENSIONS.get(type(message), {}))


def test_version_1_has_no_long_message_ids() -> None:
    with pytest.raises(EncodeError, match=r"TUNNEL.*385"):
        Codec().encode_v1(m.Tunnel(ME, 0, 0, 40000, b"x"))


@given(known_message)
def test_the_dialect_reads_what_we_write_and_the_reverse(message: m.Message) -> None:
    peer = dialect.MAVLink(None, srcSystem=message.source.system, srcComponent=message.source.component)
    data = wire(message)
    seen = peer.decode(bytearray(data))
    assert seen.get_srcSystem() == message.source.system
    known = message._replace(**UNKNOWN_TO_PEER.get(type(message), {}))
    assert Codec().feed(seen.pack(peer)) == [known]


def test_units_as_an_independent_reader_sees_them() -> None:
    seen = dialect.MAVLink(None).decode(bytearray(wire(POSITION)))
    assert (seen.time_boot_ms, seen.lat, seen.lon) == (7, 473977418, 85455938)
    assert (seen.alt, seen.relative_alt, seen.vx, seen.vy, seen.vz) == (488008, 12500, 100, -200, 25)
    assert seen.hdg == 5730
    battery = dialect.MAVLink(None).decode(bytearray(wire(m.SysStatus(ME, 1, 2, 3, 12.6, 0.75))))
    assert (battery.voltage_battery, battery.battery_remaining) == (12600, 75)
    nothing = dialect.MAVLink(None).decode(bytearray(wire(m.SysStatus(ME, 1, 2, 3, None, None))))
    assert (nothing.voltage_battery, nothing.battery_remaining) == (0xFFFF, -1)


@pytest.mark.parametrize(
    ("heading", "expected"),
    [(0, 0.0), (9000, math.pi / 2), (27000, -math.pi / 2), (36000, 0.0), (36001, None), (65535, None)],
)
def test_heading_counts_hundredths_of_a_degree_and_may_be_unknown(
    heading: int, expected: float | None
) -> None:
    peer = dialect.MAVLink(None, srcSystem=3)
    frame = dialect.MAVLink_global_position_int_message(0, 1, 1, 0, 0, 0, 0, 0, heading).pack(peer)
    (message,) = Codec().feed(frame)
    assert isinstance(message, m.GlobalPosition)
    assert message.yaw == (None if expected is None else pytest.approx(expected, abs=1e-12))


@given(st.floats(-50, 50))
def test_any_yaw_is_sent_as_the_same_direction(angle: float) -> None:
    (message,) = Codec().feed(wire(POSITION._replace(yaw=angle)))
    assert isinstance(message, m.GlobalPosition)
    assert message.yaw is not None
    assert abs(math.remainder(message.yaw - angle, math.tau)) <= math.radians(0.005) + 1e-9


# What may not leave


@pytest.mark.parametrize(
    ("message", "naming"),
    [
        (POSITION._replace(latitude=math.nan), "latitude = nan"),
        (POSITION._replace(latitude=90.1), "latitude = 90.1"),
        (POSITION._replace(longitude=-181.0), "longitude = -181.0"),
        (POSITION._replace(altitude=math.inf), "altitude = inf"),
        (POSITION._replace(velocity_ned=(0.0, 400.0, 0.0)), "vy = 40000"),
        (POSITION._replace(velocity_ned=(0.0, 0.0, math.nan)), "velocity_ned = nan"),
        (POSITION._replace(time_boot=-1000), "time_boot_ms = -1"),
        (POSITION._replace(yaw=math.nan), "yaw = nan"),
        (ORIGIN._replace(altitude=math.nan), "altitude = nan"),
        (m.LocalPosition(ME, 0, (0.0, math.nan, 0.0), (0.0, 0.0, 0.0)), "position_ned = nan"),
        (m.LocalPosition(ME, 0, (0.0, 1e39, 0.0), (0.0, 0.0, 0.0)), "y = 1e"),
        (m.Attitude(ME, 0, 0.0, 0.0, math.inf, (0.0, 0.0, 0.0)), "yaw = inf"),
        (m.SysStatus(ME, 0, 0, 0, math.nan, None), "battery_voltage = nan"),
        (m.SysStatus(ME, 0, 0, 0, 65.535, None), "battery_voltage = 65.535"),
        (m.SysStatus(ME, 0, 0, 0, None, 1.2), "battery_remaining = 1.2"),
        (BEAT._replace(base_mode=256), "base_mode = 256"),
        (BEAT._replace(source=m.Source(256, 1)), "256"),
        (m.Tunnel(ME, 0, 0, 1, bytes(129)), "129"),
        (m.CommandAck(ME, 70000, 0, 0, 0, 0, 0), "command = 70000"),
    ],
)
def test_what_does_not_fit_is_named(message: m.Message, naming: str) -> None:
    with pytest.raises(EncodeError, match=naming.replace(".", r"\.")):
        Codec().encode(message)


@pytest.mark.parametrize("odd", [math.nan, math.inf, -math.inf])
def test_commanded_values_keep_what_is_not_finite(odd: float) -> None:
    zero = (0.0, 0.0, 0.0)
    for message in (
        m.SetpointLocal(ME, 0, 1, 1, 1, 0xDC0, (odd, 1.0, 2.0), zero, zero, odd, 0.0),
        m.PositionTarget(ME, 0, 1, 0xDC0, (1.0, odd, 2.0), zero, zero, odd, 0.0),
        m.CommandLong(ME, 1, 1, 22, 0, (odd,) * 7),
        m.CommandInt(ME, 1, 1, 0, 192, (odd,) * 4, 1, 2, odd),
    ):
        (back,) = Codec().feed(wire(message))
        assert repr(back) == repr(message)


@pytest.mark.parametrize("odd", [math.nan, math.inf, -math.inf])
def test_states_that_are_not_finite_or_not_on_the_globe_are_dropped_and_counted(odd: float) -> None:
    peer = dialect.MAVLink(None, srcSystem=1)
    bad = [
        dialect.MAVLink_local_position_ned_message(0, 0, odd, 0, 0, 0, 0),
        dialect.MAVLink_attitude_message(0, 0, 0, odd, 0, -odd, 0),
        dialect.MAVLink_global_position_int_message(0, 900_000_001, 0, 0, 0, 0, 0, 0, 0),
        dialect.MAVLink_gps_global_origin_message(0, 1_800_000_001, 0),
    ]
    codec = Codec()
    assert codec.feed(b"".join(frame.pack(peer) for frame in bad)) == []
    assert codec.counters == (0, len(bad), 0, 0, 0, 0)


# Long texts


@given(st.text(max_size=400))
def test_long_texts_are_split_by_the_rule_of_the_message(long: str) -> None:
    data = Codec().encode(m.StatusText(ME, 4, long))
    pieces = []
    while data:
        length = 12 + data[1]
        pieces.append(dialect.MAVLink(None).decode(bytearray(data[:length])))
        data = data[length:]
    received = b"".join(piece._text_raw.rstrip(b"\0") for piece in pieces)
    assert received == long.replace("\0", " ").encode("ascii", "replace")
    if len(long) <= 50:
        assert [(piece.id, piece.chunk_seq) for piece in pieces] == [(0, 0)]
    else:
        assert [piece.chunk_seq for piece in pieces] == list(range(len(pieces)))
        assert len({piece.id for piece in pieces}) == 1
        assert pieces[0].id != 0
        assert [len(piece._text_raw.rstrip(b"\0")) < 50 for piece in pieces] == [False] * (
            len(pieces) - 1
        ) + [True]


def test_bytes_that_are_no_text_are_read_with_replacements() -> None:
    frame = dialect.MAVLink_statustext_message(3, b"\xff\xfe ok\0junk").pack(dialect.MAVLink(None))
    (message,) = Codec().feed(frame)
    assert isinstance(message, m.StatusText)
    assert message.text == "\ufffd\ufffd ok"


def test_sectors_of_whole_degrees_and_sound_distances_alone() -> None:
    peer = dialect.MAVLink(None, srcSystem=3)
    distances = [0, 150, 65535, 2001] + [65535] * 68
    scan = dialect.MAVLink_obstacle_distance_message(7, 0, distances, 5, 20, 2000, 0.0, -10.0, 12)
    (message,) = Codec().feed(scan.pack(peer))
    assert isinstance(message, m.ObstacleDistance)
    assert message.distances[:4] == (0.0, 1.5, None, 20.01)
    assert math.degrees(message.increment) == pytest.approx(5.0)
    assert math.degrees(message.offset) == pytest.approx(-10.0)
    scan.increment_f = math.nan
    codec = Codec()
    assert codec.feed(scan.pack(peer)) == []
    assert codec.counters.bad == 1


def test_a_figure_that_is_none_is_neither_sent_nor_heard() -> None:
    with pytest.raises(EncodeError, match="value = nan"):
        wire(m.NamedValue(ME, 0, "plan_ms", math.nan))
    with pytest.raises(EncodeError, match="longer than 10"):
        wire(m.NamedValue(ME, 0, "much too long", 1.0))
    peer = dialect.MAVLink(None, srcSystem=3)
    frame = dialect.MAVLink_named_value_float_message(0, b"plan_ms", math.inf).pack(peer)
    assert Codec().feed(frame) == []


def test_a_tracked_target_of_unknown_velocity_is_one_nevertheless() -> None:
    peer = dialect.MAVLink(None, srcSystem=3)
    unknown = (math.nan,) * 9
    frame = dialect.MAVLink_camera_tracking_geo_status_message(1, 470000000, 80000000, 450.0, *unknown)
    assert Codec().feed(frame.pack(peer)) == [m.CameraTrackingGeo(m.Source(3, 0), 1, 47.0, 8.0, 450.0, None)]
