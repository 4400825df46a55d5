"""One table: how each message of ``messages`` becomes a MAVLink payload and back. A message more, a row more.

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
from mavlink_bridge.fields import flight as f
from mavlink_bridge.fields.units import Fields, unchanged


class Converter(NamedTuple):
    """How one message goes to its payload and back.

    ``decode`` makes a message of the fields in wire order, None if they are absurd; ``encode`` the reverse.
    ``finite``: a NaN or infinity anywhere is an error (states); else it has a meaning and is kept (commands).
    ``size_v1``: payload bytes without extension fields.
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
        """The message in a payload of any length (padded with zeros, or cut), None if it is bad."""
        size = self.struct.size
        fields = self.struct.unpack(payload[:size] if len(payload) >= size else payload.ljust(size, b"\0"))
        if self.finite and not isfinite(sum(fields)):
            return None
        return self.decode(source, fields)

    def pack(self, message: m.Message) -> bytes:
        """The whole payload. Raises EncodeError naming field and value."""
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


def _row(
    message: type[m.Message],
    message_id: int,
    decode: Callable[[m.Source, Fields], m.Message | None],
    encode: Callable[[Any], Fields],
    *,
    finite: bool = False,
    size_v1: int | None = None,
) -> Converter:
    """``size_v1`` has to be said where there are extension fields: the generated classes do not mark them."""
    kind = dialect.mavlink_map[message_id]
    struct = Struct(re.sub(r"(\d+)B", r"\1s", kind.unpacker.format))
    return Converter(
        message,
        message_id,
        kind.msgname,
        bytes((kind.crc_extra,)),
        struct,
        struct.size if size_v1 is None else size_v1,
        tuple(kind.ordered_fieldnames),
        decode,
        encode,
        finite,
    )


TABLE: tuple[Converter, ...] = (
    _row(m.Heartbeat, 0, f.heartbeat, f.heartbeat_fields),
    _row(m.SysStatus, 1, f.sys_status, f.sys_status_fields, finite=True, size_v1=31),
    _row(m.SystemTime, 2, f.system_time, f.system_time_fields),
    _row(m.Ping, 4, f.ping, unchanged),
    _row(m.Attitude, 30, f.attitude, f.attitude_fields, finite=True),
    _row(m.LocalPosition, 32, f.local_position, f.local_position_fields, finite=True),
    _row(m.GlobalPosition, 33, f.global_position, f.global_position_fields, finite=True),
    _row(m.GpsGlobalOrigin, 49, f.origin, f.origin_fields, finite=True, size_v1=12),
    _row(m.CommandInt, 75, f.command_int, f.command_int_fields),
    _row(m.CommandLong, 76, f.command_long, f.command_long_fields),
    _row(m.CommandAck, 77, f.command_ack, unchanged, size_v1=3),
    _row(m.SetpointLocal, 84, f.setpoint, f.setpoint_fields),
    _row(m.PositionTarget, 85, f.position_target, f.position_target_fields),
    _row(m.Timesync, 111, f.timesync, unchanged),
    _row(m.EkfStatus, 193, f.ekf_status, f.ekf_status_fields, size_v1=22),
    _row(m.ExtendedSysState, 245, f.extended_sys_state, unchanged),
    _row(m.StatusText, 253, f.status_text, f.status_text_fields, size_v1=51),
    _row(m.Tunnel, 385, f.tunnel, f.tunnel_fields),
)
BY_ID: dict[int, Converter] = {row.id: row for row in TABLE}
BY_TYPE: dict[type[m.Message], Converter] = {row.message: row for row in TABLE}
