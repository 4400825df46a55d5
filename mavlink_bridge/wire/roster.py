"""Coordination set of a vehicle in 41 bytes of TUNNEL, sent beside its committed plan.

Sizes in bytes, little endian: kind 1, flags 1 (bit 0: farewell), epoch 7 (µs), members 32 (bit k: system id
k, 1…255).
"""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.errors import PlanWireError

PAYLOAD_TYPE = 0xDC02
"""TUNNEL.payload_type; values above 32767 are free for private use."""
KIND = 1
_FAREWELL = 1
_SIZE = 41


class Roster(NamedTuple):
    """Coordination set that goes with a committed plan.

    ``members``: system ids 1…255; ``epoch`` (µs): epoch of the plan; ``farewell``: the sender's last plan
    remains valid, and the sender makes no further plan before it has joined again.
    """

    epoch: int
    members: frozenset[int]
    farewell: bool = False


def pack(roster: Roster) -> bytes:
    """Encode ``roster`` in 41 bytes; raise PlanWireError for a value that does not fit."""
    bits = 0
    for system in roster.members:
        if not 1 <= system <= 255:
            raise PlanWireError(f"{system} is not a system id")
        bits |= 1 << system
    try:
        epoch = roster.epoch.to_bytes(7, "little")
    except OverflowError:
        raise PlanWireError(f"epoch {roster.epoch} is out of range of the wire") from None
    return bytes((KIND, _FAREWELL if roster.farewell else 0)) + epoch + bits.to_bytes(32, "little")


def unpack(data: bytes) -> Roster:
    """Decode the roster in a TUNNEL payload.

    Raises PlanWireError for anything that ``pack`` cannot produce.
    """
    if len(data) != _SIZE or data[0] != KIND or data[1] & ~_FAREWELL or data[9] & 1:
        raise PlanWireError(f"{len(data)} bytes are not a roster")
    bits = int.from_bytes(data[9:], "little")
    members = []
    while bits:
        members.append(bits.bit_length() - 1)
        bits ^= 1 << members[-1]
    return Roster(int.from_bytes(data[2:9], "little"), frozenset(members), bool(data[1] & _FAREWELL))
