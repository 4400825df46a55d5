"""Fleet time of one companion in 29 bytes of TUNNEL.

Fleet time is ahead of the sender's own clock. The message says by how much the sender takes it to be ahead
now, which dates the sender's plans, and what the sender's own sources say, without those of its peers: so no
error returns to where it came from.

Sizes in bytes, little endian: kind 1, flags 1 (bit 0: ``ahead`` is known, bit 1: ``estimate`` is known), time
7 (µs), ahead 8 (µs, signed), middle of the estimate 8 (µs, signed), its bound 4 (µs). Unknown values are 0.
"""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.errors import PlanWireError

PAYLOAD_TYPE = 0xDC04
"""TUNNEL.payload_type; values above 32767 are free for private use."""
KIND = 1
_AHEAD, _ESTIMATE = 1, 2
_SIZE = 29


class Estimate(NamedTuple):
    """Fleet time is ahead of the sender's clock by ``ahead`` ± ``bound``, µs."""

    ahead: int
    bound: int


class FleetTime(NamedTuple):
    """Fleet time of a companion at ``time`` (µs, its own clock).

    ``ahead`` (µs): what it takes fleet time to be ahead of its clock, None if it does not know. ``estimate``:
    what its own sources say, None without sources, or if they contradict each other or the others.
    """

    time: int
    ahead: int | None
    estimate: Estimate | None


def pack(message: FleetTime) -> bytes:
    """Encode ``message`` in 29 bytes; raise PlanWireError for a value that does not fit."""
    ahead, estimate = message.ahead, message.estimate
    flags = (_AHEAD if ahead is not None else 0) | (_ESTIMATE if estimate is not None else 0)
    middle, bound = estimate or (0, 0)
    try:
        return b"".join(
            (
                bytes((KIND, flags)),
                message.time.to_bytes(7, "little"),
                (ahead or 0).to_bytes(8, "little", signed=True),
                middle.to_bytes(8, "little", signed=True),
                bound.to_bytes(4, "little"),
            )
        )
    except OverflowError:
        raise PlanWireError(f"{message} is out of range of the wire") from None


def unpack(data: bytes) -> FleetTime:
    """Decode the fleet time in a TUNNEL payload.

    Raises PlanWireError for anything that ``pack`` cannot produce.
    """
    if len(data) != _SIZE or data[0] != KIND or data[1] & ~(_AHEAD | _ESTIMATE):
        raise PlanWireError(f"{len(data)} bytes are not a fleet time")
    known, estimated = data[1] & _AHEAD, data[1] & _ESTIMATE
    ahead = int.from_bytes(data[9:17], "little", signed=True)
    middle = int.from_bytes(data[17:25], "little", signed=True)
    bound = int.from_bytes(data[25:29], "little")
    if (ahead and not known) or ((middle or bound) and not estimated):
        raise PlanWireError("a fleet time with a value that its flags call unknown")
    return FleetTime(
        int.from_bytes(data[2:9], "little"),
        ahead if known else None,
        Estimate(middle, bound) if estimated else None,
    )
