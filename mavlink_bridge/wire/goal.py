"""Goal of a vehicle in TUNNEL: where it wants to go, and whether it asks others for room, in fleet-local ENU.

Others need it where two vehicles cannot pass each other and one has to give way. Sizes in bytes, little
endian: kind 1, origin 1 (the fingerprint of the fleet's frame, as in plans), reached 1 (0 or 1), position 3×4
in mm; kind 1 ends here, with 15 bytes. Kind 2 goes on with the rank 1 and the next place 3×4 in mm of a
vehicle that asks for room: 28 bytes.
"""

from __future__ import annotations

from struct import Struct
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from mavlink_bridge.errors import PlanWireError

PAYLOAD_TYPE = 0xDC07
"""TUNNEL.payload_type; values above 32767 are free for private use."""

_GOAL, _ASKING = 1, 2
_PAYLOADS = {_GOAL: Struct("<BBB3i"), _ASKING: Struct("<BBB3iB3i")}
_KINDS = {layout.size: kind for kind, layout in _PAYLOADS.items()}
_MOST_MM = 2**31 - 1
_Place = tuple[int, int, int]


class WireRoom(NamedTuple):
    """Room that a vehicle asks for, to go on to ``next_place`` (mm, fleet-local ENU).

    ``rank``: 0 if it is on the way to its goal; one more than that of the vehicle for which it makes room.
    From 7 on no vehicle leaves its goal; one on whose goal another one rests near a landed vehicle asks with
    7.
    """

    next_place: _Place
    rank: int = 0

    @property
    def next_place_m(self) -> npt.NDArray[np.float64]:
        """Next place (3,), m."""
        return _metres(self.next_place)


class WireGoal(NamedTuple):
    """Goal at ``position`` (mm, fleet-local ENU); ``origin``: 8-bit fingerprint of that frame.

    ``reached``: the vehicle has been there since it has this goal. ``room``: what it asks others for.
    """

    position: _Place
    origin: int
    reached: bool = False
    room: WireRoom | None = None

    @property
    def position_m(self) -> npt.NDArray[np.float64]:
        """Position (3,), m."""
        return _metres(self.position)


def goal_at(
    position: npt.NDArray[np.float64], origin: int, *, reached: bool = False, room: WireRoom | None = None
) -> WireGoal:
    """Return the goal at ``position`` (3,), m, in whole mm; ``reached`` and ``room`` as in ``WireGoal``.

    Raises PlanWireError for a position that is not finite or more than 2147 km away.
    """
    return WireGoal(_whole(position), origin, reached, room)


def room_to(next_place: npt.NDArray[np.float64], rank: int) -> WireRoom:
    """Return the room to go on to ``next_place`` (3,), m, in whole mm, asked for with ``rank``.

    Raises PlanWireError for a place that is not finite or more than 2147 km away.
    """
    return WireRoom(_whole(next_place), rank)


def pack(goal: WireGoal) -> bytes:
    """Return the payload of ``goal``."""
    kind = _GOAL if goal.room is None else _ASKING
    room = () if goal.room is None else (goal.room.rank, *goal.room.next_place)
    return _PAYLOADS[kind].pack(kind, goal.origin, goal.reached, *goal.position, *room)


def unpack(payload: bytes) -> WireGoal:
    """Return the goal in ``payload``; raises PlanWireError for another size or kind."""
    kind = _KINDS.get(len(payload))
    if kind is None:
        raise PlanWireError(f"goal of {len(payload)} bytes, {' or '.join(map(str, _KINDS))} are needed")
    told, origin, reached, x, y, z, *room = _PAYLOADS[kind].unpack(payload)
    if told != kind or reached > 1:
        raise PlanWireError(f"goal of kind {told}, {reached}; {kind}, 0 or 1 are known")
    asked = WireRoom((room[1], room[2], room[3]), room[0]) if room else None
    return WireGoal((x, y, z), origin, bool(reached), asked)


def _whole(place: npt.NDArray[np.float64]) -> _Place:
    """Return ``place`` (3,), m, in whole mm; raises PlanWireError if it is not finite or too far away."""
    scaled = 1e3 * np.asarray(place, dtype=np.float64)
    if not (np.abs(scaled) <= _MOST_MM).all():
        raise PlanWireError(f"goal at {place} m is not finite or too far away")
    x, y, z = (round(value) for value in scaled.tolist())
    return x, y, z


def _metres(place: _Place) -> npt.NDArray[np.float64]:
    return 1e-3 * np.array(place, dtype=np.float64)
