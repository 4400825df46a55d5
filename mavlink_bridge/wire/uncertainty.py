"""Uncertainty radius of a vehicle's reported position, in 4 bytes of TUNNEL.

It is sent beside GLOBAL_POSITION_INT, which has no field for it, while there is an uncertainty to report.

Little endian: kind 1, reserved 1 (0), radius 2 (cm, 0…65 535).
"""

from __future__ import annotations

from struct import Struct

from mavlink_bridge.errors import PlanWireError

PAYLOAD_TYPE = 0xDC03
"""TUNNEL.payload_type; values above 32767 are free for private use."""
KIND = 1
_LAYOUT = Struct("<BBH")
_MOST = 0xFFFF


def pack(radius: float) -> bytes:
    """Encode a ``radius`` in m, rounded up and limited to the largest value of the wire.

    Raises PlanWireError for a negative radius and for NaN.
    """
    if not radius >= 0.0:
        raise PlanWireError(f"{radius} m are no distance")
    return _LAYOUT.pack(KIND, 0, _MOST if radius * 100.0 >= _MOST else -int(-radius * 100.0 // 1))


def unpack(data: bytes) -> float:
    """Decode the radius (m) in a TUNNEL payload, which may have further bytes behind the known ones.

    Raises PlanWireError for anything else.
    """
    if len(data) < _LAYOUT.size or data[0] != KIND:
        raise PlanWireError(f"{len(data)} bytes are no doubt")
    return float(_LAYOUT.unpack_from(data)[2]) / 100.0
