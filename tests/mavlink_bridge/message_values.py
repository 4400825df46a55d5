"""Strategies for messages of every kind, and some messages."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import strategies as st

from mavlink_bridge import messages as m
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


def wire(message: m.Message) -> bytes:
    return Codec().encode(message)
