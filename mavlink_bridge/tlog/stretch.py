"""Undamaged stretch of a log: complete records without gaps, each with a correct checksum.

Nearly all of a log is such a stretch, so most of the reading time is spent here. Of the header only start
byte, length, flags and message id are examined; anything irregular is left to the slower search in ``log``.
"""

from __future__ import annotations

from struct import Struct
from typing import NamedTuple

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.wire.framing import CRC_EXTRA

SHORTEST_RECORD = 16
"""Bytes: a stamp and a version 1 frame without payload."""

IMPOSSIBLE = 1 << 63
"""µs: stamps from here on, 292 000 years after 1970, are damage. Times are signed numbers of 64 bits."""
_HEAD = Struct(">QBB")
_EXTRA_V1 = tuple(CRC_EXTRA.get(number) for number in range(256))
_EXTRA_V2 = {number.to_bytes(3, "little"): extra for number, extra in CRC_EXTRA.items() if number < 1 << 24}


class Record(NamedTuple):
    """One complete frame of a log, ``time`` in µs (a multiple of 4), ``link`` 0…3."""

    time: int
    link: int
    frame: bytes


class Stretch(NamedTuple):
    """Consecutive undamaged records.

    ``records`` in their order; ``end``: where the last one ends; ``time_steps_back``: number of records with
    a time before that of the previous one.
    """

    records: list[Record]
    end: int
    time_steps_back: int


def leading_records(data: bytes, start: int, before: int) -> Stretch:
    """Return the records of ``data`` from ``start`` on, up to the first irregular one.

    A record is irregular if it is damaged, cut off, of a message that the dialect lacks, or has an
    ``IMPOSSIBLE`` time. ``before``: time
    (µs) of the previous record, 0 if there is none.
    """
    records: list[Record] = []
    back, at, last = 0, start, len(data) - SHORTEST_RECORD
    # Local names save global look-ups for each record.
    add, make, head, checksum = records.append, tuple.__new__, _HEAD.unpack_from, mcrf4xx
    extra_v1, extra_v2 = _EXTRA_V1, _EXTRA_V2.get
    while at <= last:
        stamp, mark, length = head(data, at)
        if mark == mavlink.PROTOCOL_MARKER_V2:
            end = at + 18 + length
            stop = end + 2
            if data[at + 10]:
                if data[at + 10] != mavlink.MAVLINK_IFLAG_SIGNED:
                    break
                stop += mavlink.MAVLINK_SIGNATURE_BLOCK_LEN
            extra = extra_v2(data[at + 15 : at + 18])
        elif mark == mavlink.PROTOCOL_MARKER_V1:
            end = at + 14 + length
            stop = end + 2
            extra = extra_v1[data[at + 13]]
        else:
            break
        if (
            extra is None
            or stamp >= IMPOSSIBLE
            or stop > len(data)
            or checksum(data[at + 9 : end] + extra) != data[end] | data[end + 1] << 8
        ):
            break
        time = stamp & ~3
        if time < before:
            back += 1
        before = time
        # Half the cost of Record(…), which would give the same tuple.
        add(make(Record, (time, stamp & 3, data[at + 8 : stop])))
        at = stop
    return Stretch(records, at, back)
