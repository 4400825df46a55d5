"""Statement of the agreements of a vehicle with its peers, in a TUNNEL, sent beside its committed plan.

An agreement of two vehicles names one plan of each, by the epochs at which these begin. Both compute the same
separating planes from the two plans, and keep to their own sides of them.

Sizes in bytes, little endian: kind 1, flags 1 (bit 0: farewell, bit 1: away, bits 2–7: ``outside``, in units
of 0.05 m, rounded up, at most 63 of them), fingerprint of the fleet's common settings 4, epoch 7 (µs), since
7 (µs), then the entries. An entry: peer 1, flags and number 1 (bit 7: departed, bits 0–3: number of
agreements), then the newest considered agreement and the agreements, each 7 + 7 (µs: epoch of the sender's
plan, epoch of the peer's plan). An agreement that is considered and is the only one is written once (bit 6).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import ceil
from struct import Struct
from struct import error as StructError  # noqa: N812
from typing import NamedTuple

from mavlink_bridge.errors import PlanWireError

PAYLOAD_TYPE = 0xDC05
"""TUNNEL.payload_type; values above 32767 are free for private use."""
KIND = 1
LARGEST = 128
"""Largest payload of a TUNNEL (bytes)."""
MOST_AGREEMENTS = 6
"""Largest number of agreements of an entry."""
_FAREWELL, _AWAY = 1, 2
_OUTSIDE_BIT, _OUTSIDE_UNIT, _OUTSIDE_MOST = 2, 0.05, 63
_DEPARTED, _ONE, _NUMBER = 0x80, 0x40, 0x0F
_HEADER = Struct("<BBI7s7s")
_ENTRY = Struct("<BB")
_AGREEMENT = Struct("<7s7s")

Epochs = tuple[int, int]
"""Agreement as the sender writes it: epoch (µs) of its own plan, and of the peer's plan."""


class Entry(NamedTuple):
    """What the sender states about one peer.

    ``agreements``: those that the sender keeps to. ``considered``: the newest that it has taken or refused;
    of the older ones it takes none any more. (0, 0): none was considered. ``departed``: the sender has
    accepted the peer's farewell.
    """

    peer: int
    agreements: tuple[Epochs, ...] = ()
    considered: Epochs = (0, 0)
    departed: bool = False


class Statement(NamedTuple):
    """Statement of one vehicle.

    ``fingerprint``: 32 bits of the settings that the fleet has in common. ``epoch`` (µs): epoch of the
    sender's newest plan. ``since`` (µs): epoch of the first plan since which each plan began on the one
    before; agreements on an older plan of the sender are void. ``farewell``: the plan of ``epoch`` is the
    sender's last before another ``since``; the entries' ``considered`` name the newest plans of the peers
    that it holds. ``away``: the sender's vehicle is flown by another controller, and need not keep to its
    plan. ``outside`` (m): by how much its distance from its plan exceeds the tube.
    """

    fingerprint: int
    epoch: int
    since: int
    entries: tuple[Entry, ...] = ()
    farewell: bool = False
    away: bool = False
    outside: float = 0.0


def pack(statement: Statement) -> bytes:
    """Encode ``statement``; raise PlanWireError for a value that does not fit, and for too many entries."""
    try:
        flags = (_FAREWELL if statement.farewell else 0) | (_AWAY if statement.away else 0)
        flags |= _units(statement.outside) << _OUTSIDE_BIT
        epochs = _epoch(statement.epoch), _epoch(statement.since)
        parts = [_HEADER.pack(KIND, flags, statement.fingerprint, *epochs)]
        parts += [_packed(entry) for entry in statement.entries]
    except (OverflowError, ValueError, StructError):
        raise PlanWireError(f"out of range of the wire: {statement}") from None
    data = b"".join(parts)
    if len(data) > LARGEST:
        raise PlanWireError(f"{len(data)} bytes are more than {LARGEST}: {len(statement.entries)} entries")
    return data


@lru_cache(maxsize=512)
def unpack(data: bytes) -> Statement:
    """Decode a statement; raise PlanWireError for anything that ``pack`` cannot produce.

    Most statements are repeated, and in a simulation many vehicles receive the same one.
    """
    if not _HEADER.size <= len(data) <= LARGEST:
        raise PlanWireError(f"{len(data)} bytes are not a statement of agreements")
    kind, flags, fingerprint, epoch, since = _HEADER.unpack_from(data)
    if kind != KIND:
        raise PlanWireError(f"kind {kind} is not a statement of kind {KIND}")
    entries, at = [], _HEADER.size
    while at < len(data):
        entry, at = _unpacked(data, at)
        entries.append(entry)
    farewell, away = bool(flags & _FAREWELL), bool(flags & _AWAY)
    outside = (flags >> _OUTSIDE_BIT) * _OUTSIDE_UNIT
    return Statement(fingerprint, _read(epoch), _read(since), tuple(entries), farewell, away, outside)


def _units(outside: float) -> int:
    """Return ``outside`` (m) in units of the wire, rounded up."""
    if not outside >= 0.0:
        raise ValueError(f"{outside} m is not a distance")
    # The tolerance lets a decoded value give the same number again.
    return ceil(min(outside / _OUTSIDE_UNIT - 1e-6, _OUTSIDE_MOST))


def in_messages(statement: Statement) -> list[Statement]:
    """Return ``statement`` with its entries in as many statements as the payload needs, at least one."""
    groups: list[list[Entry]] = [[]]
    size = _HEADER.size
    for entry in statement.entries:
        more = _length(entry)
        if size + more > LARGEST:
            groups.append([])
            size = _HEADER.size
        groups[-1].append(entry)
        size += more
    return [statement._replace(entries=tuple(group)) for group in groups]


def _length(entry: Entry) -> int:
    """Return the number of bytes of ``_packed``."""
    one = entry.agreements == (entry.considered,)
    return _ENTRY.size + (len(entry.agreements) + (not one)) * _AGREEMENT.size


def _packed(entry: Entry) -> bytes:
    if not 1 <= entry.peer <= 255:
        raise ValueError(f"{entry.peer} is not a system id")
    if len(entry.agreements) > MOST_AGREEMENTS:
        raise ValueError(f"{len(entry.agreements)} agreements are more than {MOST_AGREEMENTS}")
    one = entry.agreements == (entry.considered,)
    written: Sequence[Epochs] = entry.agreements if one else (entry.considered, *entry.agreements)
    flags = (_DEPARTED if entry.departed else 0) | (_ONE if one else 0) | len(entry.agreements)
    pairs = b"".join(_AGREEMENT.pack(_epoch(own), _epoch(other)) for own, other in written)
    return _ENTRY.pack(entry.peer, flags) + pairs


def _unpacked(data: bytes, at: int) -> tuple[Entry, int]:
    """Return the entry that begins at byte ``at``, and where it ends."""
    if at + _ENTRY.size > len(data):
        raise PlanWireError("an entry ends early")
    peer, flags = _ENTRY.unpack_from(data, at)
    number, one = flags & _NUMBER, bool(flags & _ONE)
    written = number + (not one)
    begins = at + _ENTRY.size
    ends = begins + written * _AGREEMENT.size
    if peer == 0 or number > MOST_AGREEMENTS or (one and number != 1) or flags & 0x30 or ends > len(data):
        raise PlanWireError(f"an entry of peer {peer} with flags {flags} is not valid")
    pairs = tuple((_read(own), _read(other)) for own, other in _AGREEMENT.iter_unpack(data[begins:ends]))
    agreements = pairs if one else pairs[1:]
    if not one and agreements == pairs[:1]:
        raise PlanWireError(f"an entry of peer {peer} writes its agreement twice")
    return Entry(peer, agreements, pairs[0], bool(flags & _DEPARTED)), ends


def _epoch(epoch: int) -> bytes:
    return epoch.to_bytes(7, "little")


def _read(data: bytes) -> int:
    return int.from_bytes(data, "little")
