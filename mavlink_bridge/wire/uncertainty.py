"""Uncertainty radius of a vehicle's reported position, in 4 bytes of TUNNEL.

It is sent beside GLOBAL_POSITION_INT, which has no field for it, while there is an uncertainty to report.

Sizes in bytes, little endian: kind 1, reserved 1 (0), radius 2 (cm, 0…65 535).
"""

from __future__ import annotations

from struct import Struct

from mavlink_bridge.errors import PlanWireError

PAYLOAD_TYPE = 0xDC03
"""TUNNEL.payload_type; values above 32767 are free for private use."""
KIND = 1
_LAYOUT = Struct("<BBH")
_MAX_RADIUS_CM = 0xFFFF


def pack(radius: float) -> bytes:
    """Encode ``radius`` (m), rounded up to cm and limited to 655.35 m.

    Raises PlanWireError for a negative radius and for NaN.
    """
    if not radius >= 0.0:
        raise PlanWireError(f"{radius} m is not a radius")
    return _LAYOUT.pack(
        KIND, 0, _MAX_RADIUS_CM if radius * 100.0 >= _MAX_RADIUS_CM else -int(-radius * 100.0 // 1)
    )


def unpack(data: bytes) -> float:
    """Decode the radius (m) in a TUNNEL payload; bytes behind the first four are ignored.

    Raises PlanWireError for a shorter payload or another kind.
    """
    if len(data) < _LAYOUT.size or data[0] != KIND:
        raise PlanWireError(f"{len(data)} bytes are not an uncertainty radius")
    return float(_LAYOUT.unpack_from(data)[2]) / 100.0
