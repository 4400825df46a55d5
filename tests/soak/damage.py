"""What may happen to bytes on their way: edits of any data, and of MAVLink frames with the checksum put right
again, so that what is absurd gets as far as it can."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from math import inf, nan
from random import Random
from struct import Struct

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import BY_ID, Converter
from mavlink_bridge.wire.framing import Frame, frame_v1, frame_v2, leading_frames

MOST = 1 << 16
"""Bytes; edits never make more."""
Edit = Callable[[Random, bytes, Sequence[bytes]], bytes]

FLOATS = (nan, inf, -inf, 0.0, -0.0, 1e-45, 3.4028234e38, -3.4028234e38, 1e30, -1e20, 1e10, 1e5, -1e5, 1e3)
MARKS = (b"\xfd", b"\xfe", b"\0", b"\xff", b"\x7f", b"\x80", b"\x1f\x8b\x08")
_RUNS = (b"\0", b"\xff", b"\xfd", b"\xfe")
_LONGEST_RUN = 300


def damaged(random: Random, data: bytes, others: Sequence[bytes], edits: Sequence[Edit]) -> bytes:
    """``data`` after one to eight of ``edits``; ``others`` is what may be mixed in."""
    for _ in range(random.choice((1, 1, 1, 2, 3, 5, 8))):
        data = random.choice(edits)(random, data, others)[:MOST]
    return data


def flip(random: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """One bit."""
    if not data:
        return data
    at = random.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << random.randrange(8)]) + data[at + 1 :]


def overwrite(random: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """A few bytes by marks, or by a number that is an extreme of its width."""
    at = random.randrange(len(data) + 1)
    width = random.choice((1, 2, 4, 8))
    number = random.choice((0, 1, (1 << 8 * width) - 1, 1 << 8 * width - 1, (1 << 8 * width - 1) - 1))
    put = random.choice((random.choice(MARKS), number.to_bytes(width, "little"), random.randbytes(width)))
    return data[:at] + put + data[at + len(put) :]


def delete(random: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """A slice is lost."""
    first, last = _slice(random, data)
    return data[:first] + data[last:]


def truncate(random: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """The end is lost, or the beginning."""
    at = random.randrange(len(data) + 1)
    return data[:at] if random.random() < 0.7 else data[at:]


def duplicate(random: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """A slice is there twice, or many times."""
    first, last = _slice(random, data)
    return data[:last] + data[first:last] * random.choice((1, 1, 2, 20)) + data[last:]


def swap(random: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """Two neighbouring slices in the wrong order."""
    first, last = _slice(random, data)
    middle = random.randint(first, last)
    return data[:first] + data[middle:last] + data[first:middle] + data[last:]


def insert(random: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """Noise, or a run of one byte."""
    at = random.randrange(len(data) + 1)
    length = random.randint(1, _LONGEST_RUN)
    put = random.randbytes(length) if random.random() < 0.5 else random.choice(_RUNS) * length
    return data[:at] + put + data[at:]


def splice(random: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """A piece of something else, instead of a slice."""
    other = random.choice(others)
    first, last = _slice(random, data)
    begin, end = _slice(random, other)
    return data[:first] + other[begin:end] + data[last:]


def stretch(random: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """The length that a frame claims, the first or any."""
    starts = [at for at, byte in enumerate(data[:-1]) if byte in (0xFD, 0xFE)]
    if not starts:
        return data
    at = random.choice(starts) + 1
    return data[:at] + bytes([random.choice((0, 1, 0xFF, random.randrange(256)))]) + data[at + 1 :]


EDITS: tuple[Edit, ...] = (flip, flip, overwrite, delete, truncate, duplicate, swap, insert, splice)
WIRE_EDITS: tuple[Edit, ...] = (*EDITS, stretch, stretch)


def _slice(random: Random, data: bytes) -> tuple[int, int]:
    first = random.randrange(len(data) + 1)
    length = random.choice((random.randint(0, 8), random.randint(0, 64), random.randint(0, len(data))))
    return first, min(first + length, len(data))


# With a good checksum


def absurd(random: Random, data: bytes) -> bytes:
    """The first frame of ``data`` with extremes in some of its fields, or another header, and a checksum that
    holds; ``data`` if it begins with none."""
    frames, _ = leading_frames(data)
    row = BY_ID.get(frames[0].message_id) if frames else None
    if row is None:
        return data
    frame = frames[0]
    payload = extreme_payload(random, row, frame.payload)
    if random.random() < 0.1:
        payload = payload[: random.randrange(len(payload) + 1)]
    if random.random() < 0.1:
        payload = (payload + random.randbytes(random.randrange(64)))[:255]
    source = frame.system, frame.component
    if random.random() < 0.05:
        source = random.choice((0, 1, 11, 255, random.randrange(256))), random.randrange(256)
    return framed(random, row, frame, source, payload)


def extreme_payload(random: Random, row: Converter, payload: bytes) -> bytes:
    """``payload`` with one to all of its fields at the ends of their ranges or beyond sense."""
    values = list(row.struct.unpack(payload[: row.struct.size].ljust(row.struct.size, b"\0")))
    codes = re.findall(r"\d*[a-zA-Z]", row.struct.format)
    for place in random.sample(range(len(values)), min(len(values), random.choice((1, 1, 2, len(values))))):
        values[place] = _extreme(random, codes[place])
    return row.struct.pack(*values)


def framed(random: Random, row: Converter, frame: Frame, source: tuple[int, int], payload: bytes) -> bytes:
    """The frame around ``payload``: in its version, or in MAVLink 2 as if it were signed."""
    sequence = random.randrange(256)
    if frame.data[0] == mavlink.PROTOCOL_MARKER_V1:
        return frame_v1(row.id, row.crc_extra, source, sequence, payload[: row.size_v1])
    data = frame_v2(row.id, row.crc_extra, source, sequence, payload)
    return signed(random, row, data) if random.random() < 0.1 else data


def signed(random: Random, row: Converter, data: bytes) -> bytes:
    """A version 2 frame with the flag and thirteen bytes of a signature that nobody made."""
    from fastcrc.crc16 import mcrf4xx

    body = data[:2] + bytes([mavlink.MAVLINK_IFLAG_SIGNED]) + data[3:-2]
    return body + mcrf4xx(body[1:] + row.crc_extra).to_bytes(2, "little") + random.randbytes(13)


def _extreme(random: Random, code: str) -> float | int | bytes:
    if code.endswith("s"):
        return random.choice((bytes, random.randbytes))(int(code[:-1]))
    if code in "fd":
        return random.choice((*FLOATS, random.gauss(0.0, 10.0), random.gauss(0.0, 1e4)))
    bits = 8 * Struct("<" + code).size
    low, high = (0, (1 << bits) - 1) if code.isupper() else (-(1 << bits - 1), (1 << bits - 1) - 1)
    return random.choice((low, high, 0, 1, high - 1, high // 2, random.randint(low, high)))
