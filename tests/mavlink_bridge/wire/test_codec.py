"""Laws of the codec: what goes out comes back, whatever the bytes around it; everything is accounted for."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from mavlink_bridge import messages as m
from mavlink_bridge.errors import EncodeError
from mavlink_bridge.messages import BY_ID, BY_TYPE
from mavlink_bridge.wire.codec import Codec
from tests.mavlink_bridge.camera_values import CAMERAS
from tests.mavlink_bridge.record_values import RECORDS
from tests.mavlink_bridge.service_values import MISSIONS, SERVICES, STATUS, SURROUNDINGS
from tests.mavlink_bridge.wire_values import (
    boot,
    f32,
    latitude,
    longitude,
    millimetres,
    scaled,
    signed,
    source,
    speed,
    text,
    u8,
    u16,
    u32,
    u64,
    vector,
    yaw,
)

KINDS: dict[type[m.Message], st.SearchStrategy[Any]] = {
    m.Heartbeat: st.builds(m.Heartbeat, source, u8, u8, u8, u32, u8),
    m.SysStatus: st.builds(
        m.SysStatus,
        source,
        u32,
        u32,
        u32,
        st.none() | scaled(st.integers(0, 65534), 1e3),
        st.none() | scaled(st.integers(0, 100), 100),
    ),
    m.SystemTime: st.builds(m.SystemTime, source, u64, boot),
    m.Ping: st.builds(m.Ping, source, u64, u32, u8, u8),
    m.Attitude: st.builds(m.Attitude, source, boot, f32, f32, f32, vector(f32)),
    m.LocalPosition: st.builds(m.LocalPosition, source, boot, vector(f32), vector(f32)),
    m.GlobalPosition: st.builds(
        m.GlobalPosition,
        source,
        boot,
        latitude,
        longitude,
        millimetres,
        millimetres,
        vector(scaled(signed(16), 1e2)),
        yaw,
    ),
    m.GpsGlobalOrigin: st.builds(m.GpsGlobalOrigin, source, latitude, longitude, millimetres, u64),
    m.CommandInt: st.builds(
        m.CommandInt, source, u8, u8, u8, u16, st.tuples(f32, f32, f32, f32), signed(32), signed(32), f32
    ),
    m.CommandLong: st.builds(m.CommandLong, source, u8, u8, u16, u8, st.tuples(*[f32] * 7)),
    m.CommandAck: st.builds(m.CommandAck, source, u16, u8, u8, signed(32), u8, u8),
    m.SetpointLocal: st.builds(
        m.SetpointLocal, source, boot, u8, u8, u8, u16, vector(f32), vector(f32), vector(f32), f32, f32
    ),
    m.SetpointGlobal: st.builds(
        m.SetpointGlobal,
        source,
        boot,
        u8,
        u8,
        u8,
        u16,
        signed(32),
        signed(32),
        f32,
        vector(f32),
        vector(f32),
        f32,
        f32,
    ),
    m.SetpointAttitude: st.builds(
        m.SetpointAttitude, source, boot, u8, u8, u8, st.tuples(f32, f32, f32, f32), vector(f32), f32
    ),
    m.FollowTarget: st.builds(
        m.FollowTarget, source, boot, latitude, longitude, speed, st.none() | vector(speed)
    ),
    m.FenceStatus: st.builds(m.FenceStatus, source, boot, st.booleans(), u16, u8),
    m.PositionTarget: st.builds(
        m.PositionTarget, source, boot, u8, u16, vector(f32), vector(f32), vector(f32), f32, f32
    ),
    m.Timesync: st.builds(m.Timesync, source, signed(64), signed(64)),
    m.EkfStatus: st.builds(m.EkfStatus, source, u16, f32, f32, f32, f32),
    m.ExtendedSysState: st.builds(m.ExtendedSysState, source, u8, u8),
    m.StatusText: st.builds(m.StatusText, source, u8, text),
    m.Tunnel: st.builds(m.Tunnel, source, u8, u8, u16, st.binary(max_size=128)),
    **SERVICES,
    **MISSIONS,
    **STATUS,
    **SURROUNDINGS,
    **CAMERAS,
    **RECORDS,
}
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
# The ids of plans are newer than pymavlink 2.4.50's dialect.
UNKNOWN_TO_PEER: dict[type[m.Message], dict[str, Any]] = {
    m.MissionCount: {"opaque_id": 0},
    m.MissionAck: {"opaque_id": 0},
    m.MissionCurrent: {"mission_id": 0, "fence_id": 0, "rally_id": 0},
}
# Of development, which the peer does not speak, and newer than any dialect of pymavlink 2.4.50.
NOT_IN_DIALECT = (m.ComponentMetadata, m.AvailableMode, m.CurrentMode, m.AvailableModesMonitor)
EVERY = st.one_of(*KINDS.values())
KNOWN = st.one_of(*(of for kind, of in KINDS.items() if kind not in NOT_IN_DIALECT))


@st.composite
def messages_of(draw: st.DrawFn, *, known: bool = False) -> m.Message:
    """Any message; composite, because Hypothesis warns of the length of what it would print."""
    found: m.Message = draw(KNOWN if known else EVERY)
    return found


any_message = messages_of()
known_message = messages_of(known=True)
ME = m.Source(11, 191)
POSITION = m.GlobalPosition(
    ME, 7000, 47.3977418, 8.5455938, 488.008, 12.5, (1.0, -2.0, 0.25), math.radians(57.3)
)
BEAT = m.Heartbeat(ME, 2, 3, 81, 4, 4)
ORIGIN = m.GpsGlobalOrigin(ME, 47.0, 8.0, 400.0, 5)


def wire(message: m.Message) -> bytes:
    return Codec().encode(message)


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


# Streams


def test_each_source_counts_its_own_sequence_modulo_256() -> None:
    codec, other = Codec(), m.Source(12, 1)
    mine = [codec.encode(BEAT)[4] for _ in range(300)]
    assert mine == [number % 256 for number in range(300)]
    assert codec.encode(BEAT._replace(source=other))[4] == 0


@given(st.lists(any_message, max_size=8), st.lists(st.booleans(), min_size=8, max_size=8), st.data())
def test_chunks_make_no_difference_and_versions_mix(
    messages: list[m.Message], old: list[bool], data: st.DataObject
) -> None:
    codec = Codec()
    stream = b"".join(
        codec.encode_v1(message) if version_1 and BY_TYPE[type(message)].id < 256 else codec.encode(message)
        for message, version_1 in zip(messages, old, strict=False)
    )
    whole, pieces = Codec(), Codec()
    expected = whole.feed(stream)
    assert len(expected) == len(messages)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    found = [
        message
        for start, stop in zip([0, *cuts], [*cuts, len(stream)], strict=True)
        for message in pieces.feed(stream[start:stop])
    ]
    assert found == expected
    assert pieces.counters == whole.counters


def mutate(stream: bytes, data: st.DataObject) -> bytes:
    broken = bytearray(stream)
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, len(broken)))
        action = data.draw(st.sampled_from(["flip", "cut", "insert"]))
        if action == "insert":
            broken[at:at] = data.draw(st.binary(max_size=12))
        elif at < len(broken):
            if action == "flip":
                broken[at] ^= data.draw(st.integers(1, 255))
            else:
                del broken[at : at + data.draw(st.integers(1, 20))]
    return bytes(broken)


TRAILER = b"".join(wire(POSITION) for _ in range(20))


@given(
    st.binary(max_size=400) | st.lists(any_message, max_size=5).map(lambda x: b"".join(map(wire, x))),
    st.data(),
)
def test_any_bytes_are_survived_and_accounted_for(stream: bytes, data: st.DataObject) -> None:
    """In: bytes of frames handed out, of frames passed over, of none, and of one not yet complete."""
    stream = mutate(stream, data)
    codec = Codec()
    found = codec.feed(stream + TRAILER)
    good, bad, unknown, filtered, skipped, _ = codec.counters
    assert len(found) == good
    assert codec.pending_bytes <= 288
    assert skipped + codec.pending_bytes + 8 * (good + filtered + unknown) <= len(stream + TRAILER)
    # The longest frame has 288 bytes: garbage cannot hide more than that of what follows, unless an unknown
    # message was passed over by its length.
    if unknown == 0:
        assert found.count(POSITION) >= 20 - 288 // 40
    assert bad <= len(stream) + len(TRAILER)


@given(st.binary(max_size=300))
def test_garbage_does_not_swallow_the_frames_behind_it(garbage: bytes) -> None:
    codec = Codec()
    padding = bytes(288)
    found = codec.feed(garbage + wire(POSITION) + wire(BEAT) + padding)
    assume(codec.counters.unknown == 0)
    assert found[-2:] == [POSITION, BEAT]
    assert codec.counters.skipped_bytes + codec.pending_bytes >= len(padding) + len(garbage) * (
        len(found) == 2
    )


@given(st.lists(any_message, min_size=1, max_size=6), st.integers(0, 5), st.data())
def test_a_broken_frame_costs_only_itself(messages: list[m.Message], which: int, data: st.DataObject) -> None:
    frames = [wire(message) for message in messages]
    which %= len(frames)
    at = data.draw(st.integers(7, len(frames[which]) - 1))
    broken = bytearray(frames[which])
    broken[at] ^= data.draw(st.integers(1, 255))
    codec = Codec()
    found = codec.feed(b"".join([*frames[:which], bytes(broken), *frames[which + 1 :]]) + bytes(300))
    others = messages[:which] + messages[which + 1 :]
    # A broken message id may be one that the dialect lacks (passed over) or has (its checksum fails).
    assert found == others
    assert codec.counters.bad + codec.counters.unknown >= 1


def unknown_frame(length: int = 5) -> bytes:
    frame = bytearray(
        b"\xfd" + bytes((length, 0, 0, 9, 1, 1, 0xEF, 0xBE, 0xAD)) + bytes(length) + b"\x12\x34"
    )
    assert 0xADBEEF not in dialect.mavlink_map
    return bytes(frame)


def test_unknown_messages_are_passed_over_by_their_length() -> None:
    codec = Codec()
    hidden = bytearray(unknown_frame(len(wire(BEAT))))
    hidden[10:-2] = wire(BEAT)
    assert codec.feed(bytes(hidden) + wire(POSITION)) == [POSITION]
    assert codec.counters == (1, 0, 1, 0, 0, 0)


def test_a_false_start_that_looks_unknown_hides_nothing() -> None:
    codec = Codec()
    assert codec.feed(unknown_frame(60)[:10] + wire(POSITION) + wire(BEAT) + bytes(60)) == [POSITION, BEAT]
    assert codec.counters.unknown == 0


def test_frames_with_a_feature_that_is_not_understood_are_refused() -> None:
    frame = bytearray(wire(POSITION))
    frame[2] = 0x02
    codec = Codec()
    assert codec.feed(bytes(frame) + wire(BEAT)) == [BEAT]
    assert codec.counters.bad >= 1


@given(known_message)
def test_signed_frames_are_read(message: m.Message) -> None:
    peer = dialect.MAVLink(None, srcSystem=message.source.system, srcComponent=message.source.component)
    message = message._replace(**UNKNOWN_TO_PEER.get(type(message), {}))
    peer.signing.secret_key = bytes(range(32))
    peer.signing.sign_outgoing = True
    peer.signing.timestamp = 1
    signed_frame = dialect.MAVLink(None).decode(bytearray(wire(message))).pack(peer)
    codec = Codec()
    assert codec.feed(signed_frame + signed_frame) == [message, message]
    assert codec.counters == (2, 0, 0, 0, 0, 0)


# Filter


@given(st.lists(any_message, max_size=8), st.sets(st.sampled_from(sorted(BY_ID))))
def test_the_filter_sees_header_and_decides(messages: list[m.Message], wanted: set[int]) -> None:
    asked = []

    def accept(message_id: int, system: int, component: int) -> bool:
        asked.append((message_id, system, component))
        return message_id in wanted

    codec = Codec(accept)
    found = codec.feed(b"".join(map(wire, messages)))
    assert found == [message for message in messages if BY_TYPE[type(message)].id in wanted]
    assert asked == [(BY_TYPE[type(message)].id, *message.source) for message in messages]
    assert codec.counters == (len(found), 0, 0, len(messages) - len(found), 0, 0)


def test_the_filter_is_not_asked_about_what_fails_its_checksum() -> None:
    asked: list[int] = []
    codec = Codec(lambda message_id, system, component: bool(asked.append(message_id)))
    frame = bytearray(wire(POSITION))
    frame[20] ^= 1
    assert codec.feed(bytes(frame)) == []
    assert asked == []
    assert codec.counters.filtered == 0


def test_sound_messages_that_are_in_no_table_count_as_filtered() -> None:
    frame = dialect.MAVLink_vibration_message(1, 2, 3, 4, 5, 6, 7).pack(dialect.MAVLink(None))
    codec = Codec()
    assert codec.feed(frame) == []
    assert codec.counters == (0, 0, 0, 1, 0, 0)


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
