"""Any message of an autopilot's services, by its type."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import strategies as st

from mavlink_bridge import messages as m
from mavlink_bridge.key import Key
from tests.mavlink_bridge.wire_values import (
    boot,
    f32,
    four,
    latitude,
    longitude,
    millimetres,
    scaled,
    signed,
    source,
    u8,
    u16,
    u32,
    u64,
    vector,
    yaw,
)

name = st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=16)
raw = st.binary(min_size=4, max_size=4)
percent = scaled(st.integers(0, 100), 100)
centi = st.none() | scaled(st.integers(0, 65534), 1e2)
accuracy = scaled(u32, 1e3)
milli = scaled(signed(16), 1e3)
milli_g = signed(16).map(lambda value: value * 9.80665e-3)
Kinds = dict[type[m.Message], st.SearchStrategy[Any]]

SERVICES: Kinds = {
    m.SetMode: st.builds(m.SetMode, source, u32, u8, u8),
    m.ParamRequestRead: st.builds(m.ParamRequestRead, source, signed(16), u8, u8, name),
    m.ParamRequestList: st.builds(m.ParamRequestList, source, u8, u8),
    m.ParamValue: st.builds(m.ParamValue, source, raw, u16, u16, name, u8),
    m.ParamSet: st.builds(m.ParamSet, source, raw, u8, u8, name, u8),
    m.SetGpsGlobalOrigin: st.builds(m.SetGpsGlobalOrigin, source, latitude, longitude, millimetres, u8, u64),
    m.RequestDataStream: st.builds(m.RequestDataStream, source, u16, u8, u8, u8, u8),
    m.SetupSigning: st.builds(
        m.SetupSigning, source, u64, u8, u8, st.builds(Key, st.binary(min_size=32, max_size=32))
    ),
    m.FileTransfer: st.builds(m.FileTransfer, source, u8, u8, u8, st.binary(min_size=251, max_size=251)),
    m.AutopilotVersion: st.builds(
        m.AutopilotVersion,
        source,
        u64,
        u64,
        u32,
        u32,
        u32,
        u32,
        u16,
        u16,
        *[st.binary(min_size=8, max_size=8)] * 3,
        st.binary(min_size=18, max_size=18),
    ),
    m.HomePosition: st.builds(
        m.HomePosition, source, latitude, longitude, millimetres, vector(f32), four, vector(f32), u64
    ),
    m.SetHomePosition: st.builds(
        m.SetHomePosition, source, latitude, longitude, millimetres, vector(f32), four, vector(f32), u8, u64
    ),
    m.MessageInterval: st.builds(m.MessageInterval, source, signed(32), u16),
}

MISSIONS: Kinds = {
    m.MissionWritePartialList: st.builds(
        m.MissionWritePartialList, source, signed(16), signed(16), u8, u8, u8
    ),
    m.MissionItemFloat: st.builds(
        m.MissionItemFloat, source, four, f32, f32, f32, u16, u16, u8, u8, u8, u8, u8, u8
    ),
    m.MissionRequestFloat: st.builds(m.MissionRequestFloat, source, u16, u8, u8, u8),
    m.MissionSetCurrent: st.builds(m.MissionSetCurrent, source, u16, u8, u8),
    m.MissionCurrent: st.builds(m.MissionCurrent, source, u16, u16, u8, u8, u32, u32, u32),
    m.MissionRequestList: st.builds(m.MissionRequestList, source, u8, u8, u8),
    m.MissionCount: st.builds(m.MissionCount, source, u16, u8, u8, u8, u32),
    m.MissionClearAll: st.builds(m.MissionClearAll, source, u8, u8, u8),
    m.MissionItemReached: st.builds(m.MissionItemReached, source, u16),
    m.MissionAck: st.builds(m.MissionAck, source, u8, u8, u8, u8, u32),
    m.MissionRequest: st.builds(m.MissionRequest, source, u16, u8, u8, u8),
    m.MissionItem: st.builds(
        m.MissionItem, source, four, signed(32), signed(32), f32, u16, u16, u8, u8, u8, u8, u8, u8
    ),
}

STATUS: Kinds = {
    m.GpsRaw: st.builds(
        m.GpsRaw,
        source,
        u64,
        u8,
        latitude,
        longitude,
        millimetres,
        centi,
        centi,
        centi,
        yaw,
        st.none() | st.integers(0, 254),
        millimetres,
        accuracy,
        accuracy,
        accuracy,
    ),
    m.AttitudeQuaternion: st.builds(m.AttitudeQuaternion, source, boot, four, vector(f32)),
    m.VfrHud: st.builds(
        m.VfrHud,
        source,
        f32,
        f32,
        f32,
        f32,
        st.integers(0, 359).map(math.radians),
        scaled(u16, 100),
    ),
    m.Altitude: st.builds(m.Altitude, source, u64, *[f32] * 6),
    m.BatteryStatus: st.builds(
        m.BatteryStatus,
        source,
        u8,
        u8,
        u8,
        st.lists(scaled(st.integers(0, 65534), 1e3), max_size=10).map(tuple),
        st.none() | scaled(st.integers(0, 32767), 100),
        st.none() | st.integers(0, 2**31 - 1).map(lambda mah: mah * 3.6),
        st.none() | percent,
        signed(32),
        u8,
    ),
    m.RawImu: st.builds(m.RawImu, source, u64, vector(milli_g), vector(milli), vector(milli)),
    m.HighresImu: st.builds(m.HighresImu, source, u64, vector(f32), vector(f32), vector(f32), f32, f32, f32),
    m.SimState: st.builds(m.SimState, source, f32, f32, f32, vector(f32), vector(f32), latitude, longitude),
    m.SimulationState: st.builds(m.SimulationState, source, latitude, longitude, f32, vector(f32)),
    m.HilState: st.builds(
        m.HilState, source, u64, latitude, longitude, millimetres, vector(scaled(signed(16), 1e2))
    ),
    m.EstimatorStatus: st.builds(m.EstimatorStatus, source, u64, *[f32] * 8, u16),
}


# Composites, for Hypothesis finds strategies that are spelt out at length too long.
@st.composite
def traffic(draw: st.DrawFn) -> m.AdsbVehicle:
    callsign = st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=8)
    return m.AdsbVehicle(
        draw(source),
        draw(u32),
        draw(latitude),
        draw(longitude),
        draw(st.none() | millimetres),
        draw(st.booleans()),
        draw(yaw),
        draw(st.none() | scaled(u16, 1e2)),
        draw(st.none() | scaled(signed(16), 1e2)),
        draw(callsign),
        draw(u8),
        draw(u8) * 1_000_000,
    )


@st.composite
def scans(draw: st.DrawFn) -> m.ObstacleDistance:
    distance, degrees = st.none() | scaled(st.integers(0, 65534), 1e2), st.floats(-360, 360, width=32)
    # Mostly alike, as those of sensors with few sectors are: 72 of all kinds are slow to draw.
    some, rest = draw(st.lists(distance, max_size=8)), draw(distance)
    return m.ObstacleDistance(
        draw(source),
        draw(u64),
        draw(u8),
        (*some, *[rest] * (72 - len(some))),
        math.radians(draw(degrees)),
        draw(u16) / 1e2,
        draw(u16) / 1e2,
        math.radians(draw(degrees)),
        draw(u8),
    )


@st.composite
def figures(draw: st.DrawFn) -> m.NamedValue:
    return m.NamedValue(draw(source), draw(boot), draw(name)[:10], draw(f32))


SURROUNDINGS: Kinds = {
    m.AdsbVehicle: traffic(),
    m.NamedValue: figures(),
    m.ObstacleDistance: scans(),
}
