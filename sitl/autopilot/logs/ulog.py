"""PX4's log format (ULog): https://docs.px4.io/main/en/dev_log/ulog_file_format.html."""

from __future__ import annotations

from collections.abc import Iterable
from struct import Struct
from typing import Final

from sitl.autopilot.logs.moment import LoggedParameter, Moment
from sitl.values.attitudes import quaternion

_MAGIC: Final = b"ULog\x01\x12\x35\x01"
_HEAD: Final = Struct("<HB")
_POSITION: Final = Struct("<Q7f")
_ATTITUDE: Final = Struct("<Q4f")
_GLOBAL: Final = Struct("<Q2df")
_STATUS: Final = Struct("<QIB")
_INTEGER, _FLOAT = Struct("<i"), Struct("<f")
_FORMATS: Final = (
    "vehicle_local_position:uint64_t timestamp;float x;float y;float z;"
    "float vx;float vy;float vz;float heading;",
    "vehicle_attitude:uint64_t timestamp;float[4] q;",
    "vehicle_global_position:uint64_t timestamp;double lat;double lon;float alt;",
    "vehicle_status:uint64_t timestamp;uint32_t custom_mode;uint8_t arming_state;",
)
_LOCAL, _ATT, _WHERE, _STATE = range(4)
_DISARMED, _ARMED = 1, 2


def _message(kind: str, data: bytes) -> bytes:
    return _HEAD.pack(len(data), ord(kind)) + data


def _keyed(kind: str, key: str, value: bytes) -> bytes:
    return _message(kind, bytes((len(key),)) + key.encode() + value)


def _parameter(one: LoggedParameter) -> bytes:
    if one.whole:
        return _keyed("P", f"int32_t {one.name}", _INTEGER.pack(int(one.value)))
    return _keyed("P", f"float {one.name}", _FLOAT.pack(one.value))


def _data(topic: int, data: bytes) -> bytes:
    return _message("D", topic.to_bytes(2, "little") + data)


class Ulog:
    """Encoder of one log; ``extension`` of its file."""

    extension = "ulg"

    def __init__(self) -> None:
        self._mode, self._armed = 0, _ARMED

    def head(self, time: int, parameters: Iterable[LoggedParameter]) -> bytes:
        """Return the beginning of a log at ``time`` (µs)."""
        pieces = [_MAGIC, time.to_bytes(8, "little"), _message("B", bytes(40))]
        pieces.append(_keyed("I", "char[3] sys_name", b"PX4"))
        pieces += [_message("F", text.encode()) for text in _FORMATS]
        pieces += map(_parameter, parameters)
        for topic, text in enumerate(_FORMATS):
            name = text.partition(":")[0].encode()
            pieces.append(_message("A", b"\0" + topic.to_bytes(2, "little") + name))
        return b"".join(pieces)

    def moment(self, m: Moment) -> bytes:
        """Return the messages of one moment."""
        e = m.estimate
        local = _POSITION.pack(m.time, *e.position, *e.velocity, e.yaw)
        attitude = _ATTITUDE.pack(m.time, *quaternion(e.roll, e.pitch, e.yaw))
        place = _GLOBAL.pack(m.time, m.latitude, m.longitude, m.altitude)
        return _data(_LOCAL, local) + _data(_ATT, attitude) + _data(_WHERE, place)

    def mode(self, time: int, custom_mode: int) -> bytes:
        """Return the message of a mode."""
        self._mode = custom_mode
        return self._status(time)

    def armed(self, time: int, *, armed: bool) -> bytes:
        """Return the message of arming or disarming."""
        self._armed = _ARMED if armed else _DISARMED
        return self._status(time)

    def _status(self, time: int) -> bytes:
        return _data(_STATE, _STATUS.pack(time, self._mode, self._armed))
