"""Table of converters between the values of ``messages`` and MAVLink payloads: one row for each message.

The dialect that pymavlink generated gives ids, CRC_EXTRA, field order and struct; units and unknown-markers
are in ``fields``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from math import isfinite
from numbers import Real
from struct import Struct
from struct import error as StructError  # noqa: N812
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as dialect

from mavlink_bridge import messages as m
from mavlink_bridge.errors import EncodeError
from mavlink_bridge.wire.fields import flight as f
from mavlink_bridge.wire.fields import missions as w
from mavlink_bridge.wire.fields import services as p
from mavlink_bridge.wire.fields import status as q
from mavlink_bridge.wire.fields import surroundings as r
from mavlink_bridge.wire.fields.units import Fields, unchanged


class Converter(NamedTuple):
    """Conversion of one message to its payload and back.

    ``decode`` builds a message from the fields in wire order, or returns None if a field is invalid;
    ``encode`` is the reverse. ``finite``: a NaN or infinity anywhere is an error (state messages); otherwise
    it has a meaning and is kept (commands). ``size_v1``: payload bytes without extension fields.
    """

    message: type[m.Message]
    id: int
    name: str
    crc_extra: bytes
    struct: Struct
    size_v1: int
    field_names: tuple[str, ...]
    decode: Callable[[m.Source, Fields], m.Message | None]
    encode: Callable[[Any], Fields]
    finite: bool

    def parse(self, source: m.Source, payload: bytes) -> m.Message | None:
        """Decode a payload of any length (padded with zeros, or cut); return None if it is bad."""
        size = self.struct.size
        fields = self.struct.unpack(payload[:size] if len(payload) >= size else payload.ljust(size, b"\0"))
        if self.finite and not isfinite(sum(fields)):
            return None
        return self.decode(source, fields)

    def pack(self, message: m.Message) -> bytes:
        """Encode ``message`` as a full payload; raise EncodeError with field and value if it does not fit."""
        try:
            fields = self.encode(message)
            if self.finite and not isfinite(sum(fields)):
                raise ValueError
            return self.struct.pack(*fields)
        except (ValueError, OverflowError, StructError):
            raise self._blame(message) from None

    def _blame(self, message: m.Message) -> EncodeError:
        if self.finite:
            for name, value in zip(message._fields, message, strict=True):
                for number in value if isinstance(value, Iterable) else (value,):
                    if isinstance(number, Real) and not isfinite(number):
                        return EncodeError(f"{self.name}: {name} = {number} is not finite")
        codes = re.findall(r"\d*[a-zA-Z]", self.struct.format)
        for name, code, value in zip(self.field_names, codes, self.encode(message), strict=True):
            try:
                Struct("<" + code).pack(value)
            except (OverflowError, StructError):
                return EncodeError(f"{self.name}: {name} = {value} does not fit its field")
        return EncodeError(f"{self.name}: {message} cannot be packed")


def _spelt_out(code: str) -> str:
    """Return a struct code for each value of a field: ``4f`` is four values, ``16s`` is one."""
    return code if code.endswith("s") else code[-1] * int(code[:-1] or 1)


def _plain(message: type[Any]) -> Callable[[m.Source, Fields], Any]:
    """Return a decoder for messages that have their fields in wire order and in MAVLink's units."""
    return lambda source, fields: message(source, *fields)


def _row(
    message: type[m.Message],
    message_id: int,
    decode: Callable[[m.Source, Fields], m.Message | None],
    encode: Callable[[Any], Fields] = unchanged,
    *,
    finite: bool = False,
    size_v1: int | None = None,
    layout: str | None = None,
    more: tuple[str, ...] = (),
) -> Converter:
    """Build a converter from the dialect's definition of ``message_id``.

    ``size_v1`` is required where there are extension fields: the generated classes do not mark them.
    ``layout`` replaces the dialect's, with ``more`` extension fields that the dialect lacks.
    """
    kind = dialect.mavlink_map[message_id]
    fields = re.findall(r"\d*[a-zA-Z]", re.sub(r"(\d+)B", r"\1s", layout or kind.unpacker.format))
    codes = [_spelt_out(field) for field in fields]
    names = [
        name
        for name, code in zip((*kind.ordered_fieldnames, *more), codes, strict=True)
        for _ in re.findall(r"\d*[a-zA-Z]", code)
    ]
    struct = Struct("<" + "".join(codes))
    return Converter(
        message,
        message_id,
        kind.msgname,
        bytes((kind.crc_extra,)),
        struct,
        struct.size if size_v1 is None else size_v1,
        tuple(names),
        decode,
        encode,
        finite,
    )


TABLE: tuple[Converter, ...] = (
    _row(m.Heartbeat, 0, f.heartbeat, f.heartbeat_fields),
    _row(m.SysStatus, 1, f.sys_status, f.sys_status_fields, finite=True, size_v1=31),
    _row(m.SystemTime, 2, f.system_time, f.system_time_fields),
    _row(m.Ping, 4, f.ping, unchanged),
    _row(m.SetMode, 11, _plain(m.SetMode)),
    _row(m.ParamRequestRead, 20, p.param_request_read, p.param_request_read_fields),
    _row(m.ParamRequestList, 21, _plain(m.ParamRequestList)),
    # The value is raw bytes: conversion to float changes those that look like a signalling NaN.
    _row(m.ParamValue, 22, p.param_value, p.param_value_fields, layout="<4sHH16sB"),
    _row(m.ParamSet, 23, p.param_set, p.param_set_fields, layout="<4sBB16sB"),
    _row(m.GpsRaw, 24, q.gps_raw, q.gps_raw_fields, size_v1=30),
    _row(m.RawImu, 27, q.raw_imu, q.raw_imu_fields, size_v1=26),
    _row(m.Attitude, 30, f.attitude, f.attitude_fields, finite=True),
    _row(
        m.AttitudeQuaternion,
        31,
        q.attitude_quaternion,
        q.attitude_quaternion_fields,
        finite=True,
        size_v1=32,
    ),
    _row(m.LocalPosition, 32, f.local_position, f.local_position_fields, finite=True),
    _row(m.GlobalPosition, 33, f.global_position, f.global_position_fields, finite=True),
    _row(m.MissionWritePartialList, 38, _plain(m.MissionWritePartialList), size_v1=6),
    _row(m.MissionItemFloat, 39, w.item_float, w.item_fields, size_v1=37),
    _row(m.MissionRequestFloat, 40, _plain(m.MissionRequestFloat), size_v1=4),
    _row(m.MissionSetCurrent, 41, _plain(m.MissionSetCurrent)),
    _row(
        m.MissionCurrent,
        42,
        _plain(m.MissionCurrent),
        size_v1=2,
        layout="<HHBBIII",
        more=("mission_id", "fence_id", "rally_points_id"),
    ),
    _row(m.MissionRequestList, 43, _plain(m.MissionRequestList), size_v1=2),
    _row(m.MissionCount, 44, _plain(m.MissionCount), size_v1=4, layout="<HBBBI", more=("opaque_id",)),
    _row(m.MissionClearAll, 45, _plain(m.MissionClearAll), size_v1=2),
    _row(m.MissionItemReached, 46, _plain(m.MissionItemReached)),
    _row(m.MissionAck, 47, _plain(m.MissionAck), size_v1=3, layout="<BBBBI", more=("opaque_id",)),
    _row(m.SetGpsGlobalOrigin, 48, p.set_origin, p.set_origin_fields, size_v1=13),
    _row(m.GpsGlobalOrigin, 49, f.origin, f.origin_fields, finite=True, size_v1=12),
    _row(m.MissionRequest, 51, _plain(m.MissionRequest), size_v1=4),
    _row(m.RequestDataStream, 66, _plain(m.RequestDataStream)),
    _row(m.MissionItem, 73, w.item, w.item_fields, size_v1=37),
    _row(m.VfrHud, 74, q.vfr_hud, q.vfr_hud_fields, finite=True),
    _row(m.CommandInt, 75, f.command_int, f.command_int_fields),
    _row(m.CommandLong, 76, f.command_long, f.command_long_fields),
    _row(m.CommandAck, 77, f.command_ack, unchanged, size_v1=3),
    _row(m.SetpointAttitude, 82, f.setpoint_attitude, f.setpoint_attitude_fields),
    _row(m.SetpointLocal, 84, f.setpoint, f.setpoint_fields),
    _row(m.PositionTarget, 85, f.position_target, f.position_target_fields),
    _row(m.SetpointGlobal, 86, f.setpoint_global, f.setpoint_global_fields),
    _row(m.HighresImu, 105, q.highres_imu, q.highres_imu_fields, finite=True, size_v1=62),
    _row(
        m.SimulationState,
        108,
        q.simulation_state,
        q.simulation_state_fields,
        finite=True,
        size_v1=84,
    ),
    _row(m.FileTransfer, 110, _plain(m.FileTransfer), p.file_transfer_fields),
    _row(m.Timesync, 111, f.timesync, unchanged),
    _row(m.HilState, 115, q.hil_state, q.hil_state_fields, finite=True),
    _row(m.Altitude, 141, _plain(m.Altitude)),
    _row(m.FollowTarget, 144, f.follow_target, f.follow_target_fields),
    _row(m.BatteryStatus, 147, q.battery_status, q.battery_status_fields, size_v1=36),
    _row(m.AutopilotVersion, 148, _plain(m.AutopilotVersion), size_v1=60),
    _row(m.FenceStatus, 162, f.fence_status, f.fence_status_fields, size_v1=8),
    _row(m.SimState, 164, q.sim_state, q.sim_state_fields, finite=True),
    _row(m.EkfStatus, 193, f.ekf_status, f.ekf_status_fields, size_v1=22),
    _row(m.EstimatorStatus, 230, _plain(m.EstimatorStatus)),
    _row(m.HomePosition, 242, p.home, p.home_fields, size_v1=52),
    _row(m.SetHomePosition, 243, p.set_home, p.home_fields, size_v1=53),
    _row(m.MessageInterval, 244, _plain(m.MessageInterval)),
    _row(m.ExtendedSysState, 245, f.extended_sys_state, unchanged),
    _row(m.AdsbVehicle, 246, r.adsb, r.adsb_fields),
    _row(m.NamedValue, 251, r.named_value, r.named_value_fields),
    _row(m.StatusText, 253, f.status_text, f.status_text_fields, size_v1=51),
    _row(m.SetupSigning, 256, p.setup_signing, p.setup_signing_fields),
    _row(m.CameraTrackingGeo, 276, r.camera_tracking, r.camera_tracking_fields),
    _row(m.ObstacleDistance, 330, r.obstacle_distance, r.obstacle_distance_fields, finite=True),
    _row(m.Tunnel, 385, f.tunnel, f.tunnel_fields),
)
BY_ID: dict[int, Converter] = {row.id: row for row in TABLE}
BY_TYPE: dict[type[m.Message], Converter] = {row.message: row for row in TABLE}
