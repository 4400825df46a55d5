"""Encoding of the four bytes of PARAM_VALUE (22) and PARAM_SET (23) by each firmware.

ArduPilot casts every number to float32. PX4 stores the bytes of an int32
(MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE).
"""

from __future__ import annotations

from struct import Struct
from typing import Final

from sitl.autopilot.parameters.parameter import Kind

_FLOAT: Final = Struct("<f")
_INT: Final = Struct("<i")


def encoded(value: float, kind: Kind, *, bytewise: bool) -> bytes:
    """Return the four bytes of ``value``, which must fit ``kind``."""
    if bytewise and kind is not Kind.REAL32:
        return _INT.pack(int(value))
    return _FLOAT.pack(value)


def decoded(raw: bytes, kind: Kind, *, bytewise: bool) -> float:
    """Return the value of four bytes; it may be infinite or NaN."""
    layout = _INT if bytewise and kind is not Kind.REAL32 else _FLOAT
    return float(layout.unpack(raw)[0])
