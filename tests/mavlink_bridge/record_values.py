"""Strategies for the messages of logs, components, and of what an autopilot aims at and puts out."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from mavlink_bridge import messages as m
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
    text,
    u8,
    u16,
    u32,
    u64,
    vector,
)

milli = scaled(signed(16), 1e3)
force = signed(16).map(lambda value: value * 9.80665e-3)
short = text.map(lambda value: value[:35])

RECORDS: dict[type[m.Message], st.SearchStrategy[Any]] = {
    m.LogRequestList: st.builds(m.LogRequestList, source, u16, u16, u8, u8),
    m.LogEntry: st.builds(m.LogEntry, source, u32, u32, u16, u16, u16),
    m.LogRequestData: st.builds(m.LogRequestData, source, u32, u32, u16, u8, u8),
    m.LogData: st.builds(m.LogData, source, u32, u16, st.binary(max_size=90)),
    m.LogErase: st.builds(m.LogErase, source, u8, u8),
    m.LogRequestEnd: st.builds(m.LogRequestEnd, source, u8, u8),
    m.ComponentMetadata: st.builds(m.ComponentMetadata, source, boot, u32, text),
    m.AvailableMode: st.builds(m.AvailableMode, source, u32, u32, u8, u8, u8, short),
    m.CurrentMode: st.builds(m.CurrentMode, source, u32, u32, u8),
    m.AvailableModesMonitor: st.builds(m.AvailableModesMonitor, source, u8),
    m.AttitudeTarget: st.builds(m.AttitudeTarget, source, boot, four, vector(f32), f32, u8),
    m.PositionTargetGlobal: st.builds(
        m.PositionTargetGlobal,
        source,
        boot,
        latitude,
        longitude,
        f32,
        vector(f32),
        vector(f32),
        f32,
        f32,
        u16,
        u8,
    ),
    m.Odometry: st.builds(
        m.Odometry, source, u64, vector(f32), four, vector(f32), vector(f32), u8, u8, u8, u8
    ),
    m.ServoOutput: st.builds(m.ServoOutput, source, u32, u8, st.tuples(*[u16] * 16)),
    m.ActuatorOutputs: st.builds(m.ActuatorOutputs, source, u64, st.lists(f32, max_size=32).map(tuple)),
    m.RcChannels: st.builds(m.RcChannels, source, boot, st.lists(u16, max_size=18).map(tuple), u8),
    m.ScaledImu: st.builds(m.ScaledImu, source, boot, vector(force), vector(milli), vector(milli)),
    m.ScaledPressure: st.builds(m.ScaledPressure, source, boot, f32, scaled(signed(16), 1e2)),
    m.FlightInformation: st.builds(m.FlightInformation, source, u64, u64, u64, boot, boot),
    m.UtmGlobalPosition: st.builds(
        m.UtmGlobalPosition,
        source,
        u64,
        latitude,
        longitude,
        millimetres,
        millimetres,
        vector(scaled(signed(16), 1e2)),
        vector(scaled(u16, 1e3)),
        st.binary(min_size=18, max_size=18),
        u8,
        u8,
    ),
}
