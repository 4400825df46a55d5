"""The four bytes of PARAM_VALUE (22) and PARAM_SET (23), as each firmware means them.

ArduPilot casts every number to float32. PX4 puts the bytes of an int32 there
(MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE).
"""

from __future__ import annotations

from struct import Struct
from typing import Final

from sitl.autopilot.parameters.parameter import Kind

_FLOAT: Final = Struct("<f")
_INT: Final = Struct("<i")


def encoded(value: float, kind: Kind, *, bytewise: bool) -> bytes:
    """``value``, which fits ``kind``, on the wire."""
    if bytewise and kind is not Kind.REAL32:
        return _INT.pack(int(value))
    return _FLOAT.pack(value)


def decoded(raw: bytes, kind: Kind, *, bytewise: bool) -> float:
    """What four bytes say; it may be infinite or NaN."""
    layout = _INT if bytewise and kind is not Kind.REAL32 else _FLOAT
    return float(layout.unpack(raw)[0])
