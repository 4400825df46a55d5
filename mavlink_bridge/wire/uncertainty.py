"""How far a vehicle may be from where it says that it is, in 4 bytes of TUNNEL: sent beside its
GLOBAL_POSITION_INT, which has no field for that, while there is something to say.

Little endian: kind 1, reserved 1 (0), radius 2 (cm, 0…65 535).
"""

from __future__ import annotations

from struct import Struct

from mavlink_bridge.errors import PlanWireError

PAYLOAD_TYPE = 0xDC03
"""TUNNEL.payload_type; above 32767 is free for private use."""
KIND = 1
_LAYOUT = Struct("<BBH")
_MOST = 0xFFFF


def pack(radius: float) -> bytes:
    """A ``radius`` in m, rounded up; what is further than the wire reaches is said as that. Raises
    PlanWireError for what is none."""
    if not radius >= 0.0:
        raise PlanWireError(f"{radius} m are no distance")
    return _LAYOUT.pack(KIND, 0, _MOST if radius * 100.0 >= _MOST else -int(-radius * 100.0 // 1))


def unpack(data: bytes) -> float:
    """The radius (m) in a TUNNEL payload, which may be longer than what is known of it. Raises PlanWireError
    for anything else."""
    if len(data) < _LAYOUT.size or data[0] != KIND:
        raise PlanWireError(f"{len(data)} bytes are no doubt")
    return float(_LAYOUT.unpack_from(data)[2]) / 100.0
