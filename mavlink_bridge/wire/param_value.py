"""Number in the four bytes of PARAM_VALUE (22), in the encoding of each firmware.

ArduPilot casts every number to float32. PX4 sends the bytes of an integer unchanged
(MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE).
"""

from __future__ import annotations

from math import isfinite
from struct import unpack
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import ParamValue

_INTEGERS: Final = {
    mavlink.MAV_PARAM_TYPE_UINT8: "<Bxxx",
    mavlink.MAV_PARAM_TYPE_INT8: "<bxxx",
    mavlink.MAV_PARAM_TYPE_UINT16: "<Hxx",
    mavlink.MAV_PARAM_TYPE_INT16: "<hxx",
    mavlink.MAV_PARAM_TYPE_UINT32: "<I",
    mavlink.MAV_PARAM_TYPE_INT32: "<i",
}
"""Layout of the integer types by MAV_PARAM_TYPE."""


def number_of(message: ParamValue, *, bytewise: bool) -> float | None:
    """Return the value of ``message``, or None if it is not finite; ``bytewise``: in PX4's encoding."""
    layout = _INTEGERS.get(message.type, "<f") if bytewise else "<f"
    (number,) = unpack(layout, message.raw)
    return float(number) if isfinite(number) else None
