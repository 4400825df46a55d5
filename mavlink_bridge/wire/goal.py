"""Goal of a vehicle in 15 bytes of TUNNEL: where it wants to go, in fleet-local ENU.

Others need it where two vehicles cannot pass each other and one has to give way. Sizes in bytes, little
endian: kind 1, origin 1 (the fingerprint of the fleet's frame, as in plans), reached 1 (0 or 1), position 3×4
in mm.
"""

from __future__ import annotations

from struct import Struct
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from mavlink_bridge.errors import PlanWireError

PAYLOAD_TYPE = 0xDC07
"""TUNNEL.payload_type; values above 32767 are free for private use."""

_KIND = 1
_PAYLOAD = Struct("<BBB3i")
_MOST_MM = 2**31 - 1


class WireGoal(NamedTuple):
    """Goal at ``position`` (mm, fleet-local ENU); ``origin``: 8-bit fingerprint of that frame.

    ``reached``: the vehicle has been there since it has this goal.
    """

    position: tuple[int, int, int]
    origin: int
    reached: bool = False

    @property
    def position_m(self) -> npt.NDArray[np.float64]:
        """Position (3,), m."""
        return 1e-3 * np.array(self.position, dtype=np.float64)


def goal_at(position: npt.NDArray[np.float64], origin: int, *, reached: bool = False) -> WireGoal:
    """Return the goal at ``position`` (3,), m, in whole mm; ``reached`` as in ``WireGoal``.

    Raises PlanWireError for a position that is not finite or more than 2147 km away.
    """
    scaled = 1e3 * np.asarray(position, dtype=np.float64)
    if not (np.abs(scaled) <= _MOST_MM).all():
        raise PlanWireError(f"goal at {position} m is not finite or too far away")
    x, y, z = (round(value) for value in scaled.tolist())
    return WireGoal((x, y, z), origin, reached)


def pack(goal: WireGoal) -> bytes:
    """Return the payload of ``goal``."""
    return _PAYLOAD.pack(_KIND, goal.origin, goal.reached, *goal.position)


def unpack(payload: bytes) -> WireGoal:
    """Return the goal in ``payload``; raises PlanWireError for another size or kind."""
    if len(payload) != _PAYLOAD.size:
        raise PlanWireError(f"goal of {len(payload)} bytes, {_PAYLOAD.size} are needed")
    kind, origin, reached, x, y, z = _PAYLOAD.unpack(payload)
    if kind != _KIND or reached > 1:
        raise PlanWireError(f"goal of kind {kind}, {reached}; {_KIND}, 0 or 1 are known")
    return WireGoal((x, y, z), origin, bool(reached))
