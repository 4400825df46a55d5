"""The values that outrider exchanges: one frozen tuple per MAVLink message, SI units, the message's own
frame.

Angles are radians, distances metres, latitudes and longitudes degrees (float64, so that the degE7 step of 1.1
cm is kept), times integer µs. Positions stay local NED or geodetic as the message is: ``frames`` alone
converts. ``None`` stands for a field that the sender marked unknown. Tuples rather than dataclasses: they are
made thousands of times a second and a tuple costs a third as much.
"""

from __future__ import annotations

from mavlink_bridge.messages.flight import (
    Attitude,
    CommandAck,
    CommandInt,
    CommandLong,
    EkfStatus,
    ExtendedSysState,
    GlobalPosition,
    GpsGlobalOrigin,
    Heartbeat,
    LocalPosition,
    Ping,
    PositionTarget,
    SetpointLocal,
    StatusText,
    SysStatus,
    SystemTime,
    Timesync,
    Tunnel,
)
from mavlink_bridge.messages.source import Source, Vector

Message = (
    Heartbeat
    | SysStatus
    | SystemTime
    | Ping
    | Attitude
    | LocalPosition
    | GlobalPosition
    | GpsGlobalOrigin
    | CommandInt
    | CommandLong
    | CommandAck
    | SetpointLocal
    | PositionTarget
    | Timesync
    | EkfStatus
    | ExtendedSysState
    | StatusText
    | Tunnel
)

__all__ = [
    "Attitude",
    "CommandAck",
    "CommandInt",
    "CommandLong",
    "EkfStatus",
    "ExtendedSysState",
    "GlobalPosition",
    "GpsGlobalOrigin",
    "Heartbeat",
    "LocalPosition",
    "Message",
    "Ping",
    "PositionTarget",
    "SetpointLocal",
    "Source",
    "StatusText",
    "SysStatus",
    "SystemTime",
    "Timesync",
    "Tunnel",
    "Vector",
]
