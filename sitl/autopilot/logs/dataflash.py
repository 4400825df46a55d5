"""ArduPilot's log format (DataFlash, .BIN): self-describing records.

A record is A3 95, the number of its type, and its fields; FMT records (128) describe the types.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from struct import Struct
from typing import Final

from sitl.autopilot.logs.moment import LoggedParameter, Moment

# Name, DataFlash format, struct, columns. c is cdeg as int16 in the format's table; f avoids its rounding.
_TYPES: Final = {
    0x80: ("FMT", "BBnNZ", "BB4s16s64s", "Type,Length,Name,Format,Columns"),
    0x81: ("PARM", "QNff", "Q16sff", "TimeUS,Name,Value,Default"),
    0x82: ("ATT", "Qfff", "Qfff", "TimeUS,Roll,Pitch,Yaw"),
    0x83: ("POS", "QLLfff", "Qiifff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    0x84: ("NKF1", "Qffffff", "Qffffff", "TimeUS,VN,VE,VD,PN,PE,PD"),
    0x85: ("MODE", "QMBB", "QBBB", "TimeUS,Mode,ModeNum,Rsn"),
    0x86: ("EV", "QB", "QB", "TimeUS,Id"),
    0x87: ("MSG", "QZ", "Q64s", "TimeUS,Message"),
}
_STRUCTS: Final = {number: Struct("<" + layout) for number, (_, _, layout, _) in _TYPES.items()}
_ARMED, _DISARMED = 10, 11


def _record(number: int, *fields: object) -> bytes:
    return bytes((0xA3, 0x95, number)) + _STRUCTS[number].pack(*fields)


class DataFlash:
    """Encoder of one log; ``extension`` of its file."""

    extension = "BIN"

    def head(self, time: int, parameters: Iterable[LoggedParameter]) -> bytes:
        """Return the beginning of a log at ``time`` (µs)."""
        types = [
            _record(0x80, number, 3 + _STRUCTS[number].size, name.encode(), form.encode(), columns.encode())
            for number, (name, form, _, columns) in _TYPES.items()
        ]
        values = [_record(0x81, time, one.name.encode(), one.value, one.default) for one in parameters]
        return b"".join([*types, _record(0x87, time, b"ArduCopter V4.6.3 (outrider)"), *values])

    def moment(self, m: Moment) -> bytes:
        """Return the records of one moment."""
        e = m.estimate
        angles = (math.degrees(angle) for angle in (e.roll, e.pitch, e.yaw % math.tau))
        latitude, longitude = round(m.latitude * 1e7), round(m.longitude * 1e7)
        heights = m.altitude, m.altitude - m.home_altitude, -e.position[2]
        return (
            _record(0x82, m.time, *angles)
            + _record(0x83, m.time, latitude, longitude, *heights)
            + _record(0x84, m.time, *e.velocity, *e.position)
        )

    def mode(self, time: int, custom_mode: int) -> bytes:
        """Return the record of a mode."""
        return _record(0x85, time, custom_mode, custom_mode, 0)

    def armed(self, time: int, *, armed: bool) -> bytes:
        """Return the record of arming or disarming."""
        return _record(0x86, time, _ARMED if armed else _DISARMED)
