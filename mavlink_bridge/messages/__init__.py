"""Values that outrider exchanges: one frozen tuple per MAVLink message, SI units, the message's own frame.

Angles are radians, distances metres, latitudes and longitudes degrees (float64, so that the degE7 step of 1.1
cm is kept), times integer µs. Positions stay local NED or geodetic as in the message; only ``frames``
converts them. ``None`` stands for a field that the sender marked unknown. The values are tuples rather than
dataclasses because they are created thousands of times a second, and a tuple costs a third as much.
"""

from __future__ import annotations

from mavlink_bridge.messages.flight import (
    Attitude,
    CommandAck,
    CommandInt,
    CommandLong,
    EkfStatus,
    ExtendedSysState,
    FenceStatus,
    FollowTarget,
    GlobalPosition,
    GpsGlobalOrigin,
    Heartbeat,
    LocalPosition,
    Ping,
    PositionTarget,
    SetpointAttitude,
    SetpointGlobal,
    SetpointLocal,
    StatusText,
    SysStatus,
    SystemTime,
    Timesync,
    Tunnel,
)
from mavlink_bridge.messages.missions import (
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionCurrent,
    MissionItem,
    MissionItemFloat,
    MissionItemReached,
    MissionRequest,
    MissionRequestFloat,
    MissionRequestList,
    MissionSetCurrent,
    MissionWritePartialList,
)
from mavlink_bridge.messages.services import (
    AutopilotVersion,
    FileTransfer,
    HomePosition,
    MessageInterval,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
    ParamValue,
    RequestDataStream,
    SetGpsGlobalOrigin,
    SetHomePosition,
    SetMode,
    SetupSigning,
)
from mavlink_bridge.messages.source import Source, Vector
from mavlink_bridge.messages.status import (
    Altitude,
    AttitudeQuaternion,
    BatteryStatus,
    EstimatorStatus,
    GpsRaw,
    HighresImu,
    HilState,
    RawImu,
    SimState,
    SimulationState,
    VfrHud,
)
from mavlink_bridge.messages.surroundings import (
    AdsbVehicle,
    CameraTrackingGeo,
    NamedValue,
    ObstacleDistance,
)

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
    | SetpointGlobal
    | SetpointAttitude
    | PositionTarget
    | Timesync
    | FollowTarget
    | FenceStatus
    | EkfStatus
    | ExtendedSysState
    | StatusText
    | Tunnel
    | SetMode
    | ParamRequestRead
    | ParamRequestList
    | ParamValue
    | ParamSet
    | SetGpsGlobalOrigin
    | RequestDataStream
    | FileTransfer
    | AutopilotVersion
    | HomePosition
    | SetHomePosition
    | MessageInterval
    | MissionWritePartialList
    | MissionItemFloat
    | MissionRequestFloat
    | MissionSetCurrent
    | MissionCurrent
    | MissionRequestList
    | MissionCount
    | MissionClearAll
    | MissionItemReached
    | MissionAck
    | MissionRequest
    | MissionItem
    | GpsRaw
    | AttitudeQuaternion
    | VfrHud
    | Altitude
    | BatteryStatus
    | EstimatorStatus
    | RawImu
    | HighresImu
    | SimState
    | SimulationState
    | HilState
    | SetupSigning
    | AdsbVehicle
    | NamedValue
    | CameraTrackingGeo
    | ObstacleDistance
)

__all__ = [
    "AdsbVehicle",
    "Altitude",
    "Attitude",
    "AttitudeQuaternion",
    "AutopilotVersion",
    "BatteryStatus",
    "CameraTrackingGeo",
    "CommandAck",
    "CommandInt",
    "CommandLong",
    "EkfStatus",
    "EstimatorStatus",
    "ExtendedSysState",
    "FenceStatus",
    "FileTransfer",
    "FollowTarget",
    "GlobalPosition",
    "GpsGlobalOrigin",
    "GpsRaw",
    "Heartbeat",
    "HighresImu",
    "HilState",
    "HomePosition",
    "LocalPosition",
    "Message",
    "MessageInterval",
    "MissionAck",
    "MissionClearAll",
    "MissionCount",
    "MissionCurrent",
    "MissionItem",
    "MissionItemFloat",
    "MissionItemReached",
    "MissionRequest",
    "MissionRequestFloat",
    "MissionRequestList",
    "MissionSetCurrent",
    "MissionWritePartialList",
    "NamedValue",
    "ObstacleDistance",
    "ParamRequestList",
    "ParamRequestRead",
    "ParamSet",
    "ParamValue",
    "Ping",
    "PositionTarget",
    "RawImu",
    "RequestDataStream",
    "SetGpsGlobalOrigin",
    "SetHomePosition",
    "SetMode",
    "SetpointAttitude",
    "SetpointGlobal",
    "SetpointLocal",
    "SetupSigning",
    "SimState",
    "SimulationState",
    "Source",
    "StatusText",
    "SysStatus",
    "SystemTime",
    "Timesync",
    "Tunnel",
    "Vector",
    "VfrHud",
]
