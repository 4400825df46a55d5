"""What it tells, when, to whom; that it is a node like any other; and the truth beside it."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.frames import FleetFrame, ned_to_enu, yaw_to_enu
from mavlink_bridge.messages import (
    Attitude,
    CommandAck,
    CommandLong,
    EkfStatus,
    EstimatorStatus,
    ExtendedSysState,
    GlobalPosition,
    GpsGlobalOrigin,
    Heartbeat,
    HighresImu,
    LocalPosition,
    Message,
    Ping,
    RawImu,
    RequestDataStream,
    SimState,
    Source,
    StatusText,
    SysStatus,
    Timesync,
)
from mavlink_bridge.node import Node
from mavlink_bridge.wire.codec import Codec
from sitl.config.autopilot import AutopilotConfig
from sitl.node import Autopilot
from sitl.values.origin import Origin
from tests.sitl.autopilot_rig import (
    ALL,
    ARM,
    FIREFLY,
    FLAVOURS,
    INTERVAL,
    PILOT,
    REQUEST,
    SITE,
    VELOCITY_YAW,
    Rig,
    setpoint,
)

RATES: list[tuple[type[Message], float]] = [
    (Heartbeat, 1.0),
    (SysStatus, 1.0),
    (Attitude, 50.0),
    (LocalPosition, 50.0),
    (GlobalPosition, 10.0),
    (GpsGlobalOrigin, 0.2),
    (ExtendedSysState, 2.0),
]


def test_it_is_a_node():
    node: Node = Rig().autopilot
    assert node.name == "sitl-11"


@pytest.mark.parametrize("tick", [2_500, 5_000, 10_000])
def test_every_message_comes_at_its_rate_to_the_microsecond(tick):
    rig = Rig(tick=tick)
    rig.run(2.0)
    rig.received.clear()
    rig.run(10.0)
    for kind, hz in RATES:
        times = [now for now, m in rig.received if isinstance(m, kind)]
        assert len(times) == round(10 * hz)
        assert set(np.diff(times)) <= {round(1e6 / hz)}
    assert len(rig.all(EkfStatus)) == 10


def test_px4_sends_no_ardupilot_messages():
    rig = Rig("px4")
    rig.run(3.0)
    assert not rig.all(EkfStatus)


def test_a_px4_that_waits_for_a_position_reports_no_gps_glitch():
    """The same bit means "not initialised" in ArduPilot's EKF_STATUS_REPORT."""
    rig = Rig("px4", ready_after=1.5)
    rig.run(1.2)
    assert rig.order(REQUEST, 230) == [0]
    assert not rig.all(EstimatorStatus)[-1].flags & (0x400 | 0x10)


def test_rates_are_set_reset_and_switched_off():
    rig = Rig()
    rig.run(2.0)
    for interval, count in ((100_000, 10), (5_000, 200), (-1, 0), (0, 50)):
        assert rig.order(INTERVAL, 32, interval) == [0]
        rig.received.clear()
        rig.run(1.0)
        assert len(rig.all(LocalPosition)) == count


def test_a_slow_clock_gets_each_message_at_most_once_a_step():
    rig = Rig(tick=100_000)
    rig.run(5.0)
    rig.received.clear()
    rig.run(10.0)
    assert len(rig.all(LocalPosition)) == 100
    assert len(rig.all(GlobalPosition)) == 100
    assert len(rig.all(Heartbeat)) == 10


@pytest.mark.parametrize(
    ("message_id", "kind"), [(0, Heartbeat), (49, GpsGlobalOrigin), (33, GlobalPosition)]
)
def test_messages_are_sent_on_request_too(message_id, kind):
    rig = Rig(rates={"gps_global_origin": 0.0, "global_position": 0.0})
    rig.run(1.5)
    seen = len(rig.all(kind))
    assert rig.order(REQUEST, message_id) == [0]
    assert len(rig.all(kind)) == seen + 1


def test_position_comes_with_readiness_and_the_origin_with_it():
    rig = Rig(ready_after=1.5)
    rig.run(1.4)
    assert not rig.all(LocalPosition)
    assert not rig.all(GlobalPosition)
    assert not rig.all(GpsGlobalOrigin)
    gps, prearm = 0x20, 0x10000000
    assert not rig.all(SysStatus)[-1].health & (gps | prearm)
    assert not rig.all(EkfStatus)[-1].flags & 0x10
    rig.run(1.0)
    assert len(rig.all(GpsGlobalOrigin)) == 1
    assert rig.all(SysStatus)[-1].health & (gps | prearm) == gps | prearm
    assert rig.all(EkfStatus)[-1].flags & 0x10


@pytest.mark.parametrize("to", [(12, 1), (12, 0), (11, 2), (255, 255)])
def test_what_is_for_others_is_left_alone(to):
    rig = Rig()
    rig.run(1.1)
    rig.received.clear()
    assert rig.order(ARM, 1, to=to) == []
    rig.step(setpoint(frame=99, to=to))
    assert rig.texts == []
    assert not rig.autopilot.armed


@pytest.mark.parametrize("to", [(11, 1), (11, 0), (0, 0)])
def test_what_is_for_it_or_for_all_is_obeyed(to):
    rig = Rig()
    rig.run(1.1)
    assert rig.order(ARM, 1, to=to) == [0]
    ack = rig.all(CommandAck)[-1]
    assert (ack.target_system, ack.target_component) == PILOT
    assert rig.autopilot.armed


def test_timesync_and_ping_are_answered():
    rig = Rig()
    rig.run(1.0)
    rig.step(Timesync(PILOT, 0, 123_456), Ping(PILOT, 77, 5, 0, 0))
    assert rig.all(Timesync) == [Timesync(Source(11, 1), 1_000_000_000, 123_456)]
    assert rig.all(Ping) == [Ping(Source(11, 1), 77, 5, *PILOT)]
    rig.step(Timesync(PILOT, 9, 123), Ping(PILOT, 77, 5, 11, 1))
    assert len(rig.all(Timesync)) == len(rig.all(Ping)) == 1


def test_an_ardupilot_streams_nothing_before_a_request_and_then_what_was_requested():
    rig, found = Rig("ardupilot", streams="normal"), []
    for second in range(8):
        begin = len(rig.received)
        if second == 4:
            rig.step(RequestDataStream(PILOT, 4, 11, 1, mavlink.MAV_DATA_STREAM_POSITION, 1))
        rig.run(1.0)
        found.append(Counter(type(message) for _, message in rig.received[begin:]))
    assert found[0].keys() <= {Heartbeat, StatusText, Timesync, GpsGlobalOrigin}
    assert found[2] == found[3] == {Heartbeat: 1}
    assert found[6] == {Heartbeat: 1, LocalPosition: 4, GlobalPosition: 4}


def test_timesync_of_a_client_with_an_autopilots_component_is_answered_and_an_autopilots_is_not():
    """Ten PX4s on one link ask a hundred times a second; a client may have any component."""
    rig, client, other = Rig(), Source(255, 1), Source(12, 1)
    rig.run(1.0)
    rig.step(Heartbeat(client, 6, 8, 0, 0, 4), Heartbeat(other, 2, 12, 0, 0, 4))
    for k, source in enumerate((client, other, Source(254, 1), Source(12, 195))):
        rig.step(Timesync(source, 0, 1 + k))
    assert [message.ts1 for message in rig.all(Timesync)] == [1, 3, 4]


@settings(max_examples=60, deadline=None)
@given(chunks=st.lists(st.binary(max_size=300), max_size=8))
def test_garbage_is_ignored(chunks):
    rig, quiet = Rig(), Rig()
    for chunk in (*chunks, b"", b"", b"", b""):
        rig.step_bytes(chunk)
        quiet.step_bytes(b"")
    assert rig.bytes == quiet.bytes


def test_other_links_are_not_heard():
    rig = Rig()
    rig.run(1.1)
    rig.step_bytes(Codec().encode(CommandLong(PILOT, 11, 1, ARM, 0, (1.0, *[0.0] * 6))), link="swarm")
    assert not rig.autopilot.armed


def flown(tick=5_000, flavour="ardupilot", start=0):
    """A short flight whose messages come at the same times whatever the tick: true positions, and bytes."""
    rig = Rig(flavour, tick=tick)
    rig.now = start
    tracks = []
    for k in range(round(8e6 / tick)):
        t = k * tick
        message = {1_200_000: (176, 1, 4), 1_300_000: (ARM, 1), 1_400_000: (22, 0, 0, 0, 0, 0, 0, 3.0)}.get(t)
        if message:
            rig.step(CommandLong(PILOT, 11, 1, message[0], 0, (*map(float, message[1:]), *[0.0] * 7)[:7]))
        elif t > 5e6 and t % 20_000 == 0:
            rig.step(setpoint(VELOCITY_YAW, velocity=(1.0, 0.5, -0.2)))
        else:
            rig.step()
        tracks.append(rig.autopilot.trace)
    return np.concatenate(tracks), rig


def test_the_same_flight_twice_is_the_same_to_the_bit():
    (first, one), (second, two) = flown(), flown()
    assert np.array_equal(first, second)
    assert one.bytes == two.bytes


def test_the_flight_does_not_depend_on_when_the_clock_started():
    (first, one), (second, two) = flown(), flown(start=1_700_000_000_000_000)
    assert np.array_equal(first, second)
    assert one.bytes == two.bytes


@pytest.mark.parametrize("tick", [10_000, 20_000])
def test_the_flight_does_not_depend_on_the_tick(tick):
    (fine, _), (coarse, _) = flown(5_000), flown(tick)
    count = min(len(fine), len(coarse))
    assert np.abs(fine[:count] - coarse[:count]).max() < 0.02


def test_the_trace_is_every_physics_step_with_its_time():
    rig = Rig(tick=12_500)
    rig.now = 3_000
    rig.step()
    assert rig.autopilot.trace.shape == (0, 3)
    assert rig.autopilot.trace_times.shape == (0,)
    times = []
    for _ in range(100):
        rig.step()
        assert rig.autopilot.trace.shape == (len(rig.autopilot.trace_times), 3)
        assert np.array_equal(rig.autopilot.trace[-1], rig.position)
        times += rig.autopilot.trace_times.tolist()
    assert times == [3_000 + k * FIREFLY.physics_period for k in range(1, 501)]


def test_local_and_global_positions_are_the_truth():
    rig = Rig(yaw=0.7).hover(5.0)
    rig.run(6.0, setpoint(ALL, (3.0, -2.0, -5.0), yaw=1.2))
    local, world, attitude = rig.all(LocalPosition)[-1], rig.all(GlobalPosition)[-1], rig.all(Attitude)[-1]
    np.testing.assert_allclose(local.position_ned, (3.0, -2.0, -5.0), atol=0.02)
    np.testing.assert_allclose(
        SITE.to_enu(world.latitude, world.longitude, world.altitude), (-2, 3, 5), atol=0.03
    )
    assert world.relative_altitude == pytest.approx(5.0, abs=0.02)
    assert attitude.yaw == pytest.approx(1.2, abs=0.02)
    assert world.yaw == pytest.approx(1.2, abs=0.02)


@settings(max_examples=30)
@given(
    latitude=st.floats(-70, 70),
    longitude=st.floats(-179, 179),
    offset=st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-50, 50)),
    point=st.tuples(*[st.floats(-500, 500)] * 3),
)
def test_an_origin_converts_there_and_back(latitude, longitude, offset, point):
    site = FleetFrame(latitude, longitude, 100.0)
    origin = Origin(site, latitude + offset[0], longitude + offset[1], 100.0 + offset[2])
    moved = origin.motion_to_site((point, point))
    np.testing.assert_allclose(origin.position_to_local(moved[0]), point, atol=1e-8)
    np.testing.assert_allclose(origin.vector_to_local(moved[1]), point, atol=1e-9)
    np.testing.assert_allclose(site.to_enu(*origin.geodetic(point)), ned_to_enu(moved[0]), atol=1e-5)
    assert round(origin.latitude * 1e7) / 1e7 == origin.latitude


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_vehicles_with_different_origins_agree_on_where_they_are(flavour):
    """Two vehicles 1.4 km apart, and a third party that knows only their messages."""
    rigs = [
        Rig(flavour, latitude=SITE.latitude + north, longitude=SITE.longitude + east, altitude=488.0 + up)
        for north, east, up in ((0.0, 0.0, 0.0), (0.01, -0.012, 20.0))
    ]
    for rig in rigs:
        rig.hover(5.0)
        rig.step(setpoint(VELOCITY_YAW, velocity=(1.0, -2.0, 0.0)))
        rig.guided()
        rig.run(2.0, setpoint(VELOCITY_YAW, velocity=(1.0, -2.0, 0.0), yaw=0.4))
        while rig.all(GlobalPosition)[-1].time_boot != rig.now - rig.tick:
            rig.step(setpoint(VELOCITY_YAW, velocity=(1.0, -2.0, 0.0), yaw=0.4))
        origin, local, world = (
            rig.all(kind)[-1] for kind in (GpsGlobalOrigin, LocalPosition, GlobalPosition)
        )
        assert local.time_boot == world.time_boot
        frame = SITE.local(origin.latitude, origin.longitude, origin.altitude)
        truth = ned_to_enu(rig.position)
        np.testing.assert_allclose(frame.position_to_fleet(local.position_ned), truth, atol=1e-3)
        np.testing.assert_allclose(
            SITE.to_enu(world.latitude, world.longitude, world.altitude), truth, atol=0.02
        )
        np.testing.assert_allclose(
            frame.velocity_to_fleet(local.velocity_ned), ned_to_enu(rig.autopilot.state.velocity), atol=1e-5
        )
        attitude = rig.all(Attitude)[-1]
        w, x, y, z = rig.autopilot.state.attitude
        true_yaw = yaw_to_enu(math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
        assert math.remainder(frame.yaw_to_fleet(attitude.yaw) - true_yaw, math.tau) == pytest.approx(
            0, abs=1e-4
        )
    apart = rigs[1].position - rigs[0].position
    assert np.linalg.norm(apart) > 1000.0


def test_what_is_not_a_setting_is_refused():
    with pytest.raises(ValidationError):
        AutopilotConfig(system_id=1, latitude=0.0, longitude=0.0, speeed=3.0)
    with pytest.raises(ValidationError):
        AutopilotConfig(system_id=0, latitude=0.0, longitude=0.0)


def test_true_sensors_do_not_depend_on_the_seed():
    config = Rig().config
    a, b = (Autopilot(config, FIREFLY, SITE, seed=seed) for seed in (1, 2))
    assert a.step(0, []) == b.step(0, [])


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_inertial_sensors_feel_the_rotors_and_the_ground(flavour):
    ids = {"ardupilot": (RawImu, 27), "px4": (HighresImu, 105)}
    kind, number = ids[flavour]
    rig = Rig(flavour)
    rig.run(1.1)
    rig.order(REQUEST, number)
    rig.hover(5.0)
    rig.order(REQUEST, number)
    standing, hovering = rig.all(kind)
    for imu in (standing, hovering):
        assert imu.specific_force == pytest.approx((0.0, 0.0, -9.81), abs=0.03)
        assert math.hypot(*imu.magnetic_field) == pytest.approx(0.4758, abs=0.002)
    # Looking east, north is to the left.
    turned = Rig(flavour, yaw=math.pi / 2)
    turned.run(1.1)
    turned.order(REQUEST, number)
    north, east, down = standing.magnetic_field
    assert turned.all(kind)[0].magnetic_field == pytest.approx((east, -north, down), abs=0.002)


def test_simstate_is_the_truth():
    rig = Rig("ardupilot", sensors="gnss").hover(5.0)
    rig.order(REQUEST, 164)
    (said,) = rig.all(SimState)
    east, north, _ = SITE.to_enu(said.latitude, said.longitude, SITE.altitude)
    assert (north, east) == pytest.approx(tuple(rig.position[:2]), abs=0.02)
