"""Framing of MAVLink in a byte stream: where frames begin and end, and whether their checksum is correct.

Source: the MAVLink serialisation guide. Version 1 is ``FE len seq sys comp id payload crc``; version 2 is
``FD len incompat compat seq sys comp id(3) payload crc [signature(13)]``, with trailing zeros of the payload
left out. The checksum is CRC-16/MCRF4XX over header without start byte, payload, and the message's CRC_EXTRA.

Frames whose incompatibility flags are not understood are skipped whole: their payload is not searched for
frames. Two such flags are known by their length: with 0x02 the system id has four bytes, and with 0x04 the
target's system id (four bytes) and component id follow the message id (pymavlink pull request 1229).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from enum import Enum
from functools import lru_cache
from struct import Struct
from typing import NamedTuple

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import BY_ID

_MARKERS = (mavlink.PROTOCOL_MARKER_V1, mavlink.PROTOCOL_MARKER_V2)
MAX_CACHED_BYTES = 512
"""Length of the longest datagram whose frames are cached."""
LONGEST_FRAME = 288  # version 2: 10 header, 3 and 5 of flags, 255 payload, 2 checksum, 13 signature
_LONG_IDS, _TARGETED = 0x02, 0x04
"""Incompatibility flags: the system id has four bytes; the target's ids are in the header."""

STARTS = re.compile(b"[\xfd\xfe]")
_HEADER_V1 = Struct("<6B")
_HEADER_V2 = Struct("<7BHB")
_CHECKED_HEADER_V2 = Struct("<6BHB")
"""The header of version 2 without the start byte: the part that the checksum covers."""
CRC_EXTRA: dict[int, bytes] = {
    **{number: bytes((kind.crc_extra,)) for number, kind in mavlink.mavlink_map.items()},
    # The dialect lacks messages that are declared here.
    **{number: row.crc_extra for number, row in BY_ID.items()},
}
"""CRC_EXTRA by message id.

The dialect ``all`` contains ardupilotmega, and ``development``, whose messages PX4 logs and which could not
be verified otherwise. No id has two meanings in it.
"""


class Frame(NamedTuple):
    """One frame as it was on the wire.

    ``data`` is the whole frame, ``payload`` its payload as sent (MAVLink 2 senders cut trailing zeros).

    ``known`` is False if the dialect lacks the message id; the checksum is then unverified. ``signed``: the
    frame ends with 13 bytes of signature, which are not verified here.
    """

    version: int
    sequence: int
    system: int
    component: int
    message_id: int
    signed: bool
    known: bool
    payload: bytes
    data: bytes


class Flaw(Enum):
    """Reason why there is no frame: the bytes end too early, or no valid frame starts here.

    ``INCOMPATIBLE``: a frame with an incompatibility flag that is not understood; ``skipped_to`` has its end.
    """

    PARTIAL = "partial"
    FALSE_START = "false start"
    INCOMPATIBLE = "incompatible"


def at_boundary(data: bytes, at: int) -> bool:
    """Return whether ``data`` ends or a frame may begin at ``at``: the only check of an unverified frame."""
    return at == len(data) or data[at] in _MARKERS


def skipped_to(data: bytes, start: int, *, whole: bool) -> int | Flaw:
    """Return where the incompatible frame at ``data[start]``, which ``frame_at`` found, ends.

    Such a frame is skipped if its checksum is correct, or if a start byte follows it, or, if ``whole``, the
    end of ``data``. ``Flaw.PARTIAL``: this depends on bytes that follow ``data``. ``Flaw.FALSE_START``: no
    frame begins here.
    """
    flags = data[start + 2]
    length, signature = _lengths(data[start + 1], flags)
    after = start + length
    if after > len(data):
        return Flaw.FALSE_START if whole else Flaw.PARTIAL
    message_id, end = start + (10 if flags & _LONG_IDS else 7), after - signature - 2
    extra = CRC_EXTRA.get(int.from_bytes(data[message_id : message_id + 3], "little"))
    if extra is not None and mcrf4xx(data[start + 1 : end] + extra) == data[end] | data[end + 1] << 8:
        return after
    if after == len(data) and not whole:
        return Flaw.PARTIAL
    return after if at_boundary(data, after) else Flaw.FALSE_START


def _lengths(payload: int, flags: int) -> tuple[int, int]:
    """Return the lengths (bytes) of a version 2 frame with ``flags`` and of its signature, which is in it."""
    signature: int = mavlink.MAVLINK_SIGNATURE_BLOCK_LEN if flags & mavlink.MAVLINK_IFLAG_SIGNED else 0
    ids = (3 if flags & _LONG_IDS else 0) + (5 if flags & _TARGETED else 0)
    return 12 + ids + payload + signature, signature


def frame_at(data: bytes, start: int) -> Frame | Flaw:
    """Return the frame that starts at ``data[start]``, or the reason why there is none.

    A wrong checksum is a false start. A frame with an incompatibility flag other than *signed* is not read,
    as MAVLink demands.
    """
    size = len(data)
    if start >= size:
        return Flaw.PARTIAL
    mark = data[start]
    if mark == mavlink.PROTOCOL_MARKER_V2:
        if start + 10 > size:
            return Flaw.PARTIAL
        _, length, flags, _, sequence, system, component, low, high = _HEADER_V2.unpack_from(data, start)
        if flags > mavlink.MAVLINK_IFLAG_SIGNED:
            return Flaw.INCOMPATIBLE
        version, signed, message_id = 2, flags == mavlink.MAVLINK_IFLAG_SIGNED, low | high << 16
        body = start + 10
        end = body + length
        stop = end + 2 + mavlink.MAVLINK_SIGNATURE_BLOCK_LEN if signed else end + 2
    elif mark == mavlink.PROTOCOL_MARKER_V1:
        if start + 6 > size:
            return Flaw.PARTIAL
        _, length, sequence, system, component, message_id = _HEADER_V1.unpack_from(data, start)
        version, signed = 1, False
        body = start + 6
        end = body + length
        stop = end + 2
    else:
        return Flaw.FALSE_START
    if stop > size:
        return Flaw.PARTIAL
    extra = CRC_EXTRA.get(message_id)
    if extra is not None and mcrf4xx(data[start + 1 : end] + extra) != data[end] | data[end + 1] << 8:
        return Flaw.FALSE_START
    return Frame(
        version,
        sequence,
        system,
        component,
        message_id,
        signed,
        extra is not None,
        data[body:end],
        data[start:stop],
    )


@lru_cache(maxsize=1024)
def _leading(data: bytes) -> tuple[tuple[Frame, ...], int]:
    frames: list[Frame] = []
    at, size = 0, len(data)
    while at < size:
        frame = frame_at(data, at)
        if isinstance(frame, Flaw) or not frame.known:
            break
        frames.append(frame)
        at += len(frame.data)
    return tuple(frames), at


def leading_frames(data: bytes) -> tuple[tuple[Frame, ...], int]:
    """Return the known, valid frames at the beginning of ``data``, and where they end.

    The frames follow each other without a gap, are of messages of the dialect, and have a correct checksum. A
    datagram usually holds nothing else.

    Results for short data are cached: in one process every receiver and every log reads the same datagram,
    and its frames depend only on its bytes.
    """
    # A bytearray may change, and may not be hashed.
    short = type(data) is bytes and len(data) <= MAX_CACHED_BYTES
    return _leading(data) if short else _leading.__wrapped__(data)


def claimed_length(data: bytes, start: int) -> int | None:
    """Return the frame length by the unverified header at ``data[start]``, or None if that is no header."""
    mark = data[start : start + 1]
    if mark == b"\xfd" and start + 3 <= len(data):
        return _lengths(data[start + 1], data[start + 2])[0]
    if mark == b"\xfe" and start + 2 <= len(data):
        return 8 + data[start + 1]
    return None


def frame_v2(
    message_id: int,
    crc_extra: bytes,
    source: tuple[int, int],
    sequence: int,
    payload: bytes,
    flags: int = 0,
) -> bytes:
    """Return a version 2 frame; trailing zeros of ``payload`` are cut off, down to one byte.

    ``flags``: MAVLINK_IFLAG_SIGNED if a signature will be appended.
    """
    payload = payload.rstrip(b"\0") or b"\0"
    system, component = source
    body = _CHECKED_HEADER_V2.pack(
        len(payload), flags, 0, sequence, system, component, message_id & 0xFFFF, message_id >> 16
    )
    body += payload
    return b"\xfd" + body + mcrf4xx(body + crc_extra).to_bytes(2, "little")


def frame_v1(
    message_id: int, crc_extra: bytes, source: tuple[int, int], sequence: int, payload: bytes
) -> bytes:
    """Return a version 1 frame of ``payload``, which must be complete and without extension fields."""
    body = _HEADER_V1.pack(mavlink.PROTOCOL_MARKER_V1, len(payload), sequence, *source, message_id) + payload
    return body + mcrf4xx(body[1:] + crc_extra).to_bytes(2, "little")


def without_signature(data: bytes) -> bytes:
    """Return a frame as it was before it was signed; an unsigned frame is returned unchanged.

    The checksum of the result is correct if that of ``data`` is.
    """
    if data[0] != mavlink.PROTOCOL_MARKER_V2 or data[2] != mavlink.MAVLINK_IFLAG_SIGNED:
        return data
    end: int = len(data) - mavlink.MAVLINK_SIGNATURE_BLOCK_LEN - 2
    body = data[:2] + b"\0" + data[3:end]
    # The checksum is linear: the contribution of CRC_EXTRA to both cancels in their difference.
    change = mcrf4xx(data[1:end] + b"\0") ^ mcrf4xx(body[1:] + b"\0")
    return body + ((data[end] | data[end + 1] << 8) ^ change).to_bytes(2, "little")


class Framer:
    """Splitter of a byte stream, in pieces of any length, into frames.

    It keeps at most 288 bytes between two calls. After a false start the search continues one byte later. A
    frame of an unknown message cannot be verified. It is therefore accepted only if a start byte follows it
    (the framer waits for this byte); otherwise it counts as a false start. ``whole``: no frame continues in
    the next call, so nothing waits, and an unknown frame at the end of the data is accepted. A frame with
    incompatibility flags that are not understood is skipped under the same condition, or if its checksum is
    correct. ``frames`` counts known frames, ``unknown`` accepted unknown and skipped ones, ``bad`` false
    starts, and ``skipped_bytes`` the bytes that belong to no frame.
    """

    def __init__(self, *, unknown: bool = False) -> None:
        """If ``unknown``, also return frames of unknown messages, with their checksum unverified."""
        self._returns_unknown = unknown
        self.frames = 0
        self.bad = 0
        self.unknown = 0
        self.skipped_bytes = 0
        self.rest = b""

    @property
    def pending_bytes(self) -> int:
        """Number of bytes kept for the next call."""
        return len(self.rest)

    def feed(self, data: bytes, *, whole: bool = False) -> Sequence[Frame]:
        """Return the frames that ``data`` completes, with a correct checksum (unknown ones: unverified)."""
        if self.rest:
            data = self.rest + data
        # As ``leading_frames``, without the call: every datagram passes here.
        short = type(data) is bytes and len(data) <= MAX_CACHED_BYTES
        frames, at = _leading(data) if short else _leading.__wrapped__(data)
        if at == len(data):
            self.rest = b""
            self.frames += len(frames)
            return frames
        return self._search(data, at, list(frames), whole=whole)

    def _search(self, data: bytes, at: int, found: list[Frame], *, whole: bool) -> list[Frame]:
        """Return ``found`` and the frames of ``data`` from ``at`` on, where an irregularity begins."""
        size = len(data)
        while at < size:
            frame = frame_at(data, at)
            if frame is Flaw.INCOMPATIBLE:
                end = skipped_to(data, at, whole=whole)
                if not isinstance(end, Flaw):
                    self.unknown += 1
                    at = end
                    continue
                frame = end
            if frame is Flaw.PARTIAL and not whole:
                break
            if not isinstance(frame, Flaw):
                after = at + len(frame.data)
                if frame.known:
                    found.append(frame)
                    at = after
                    continue
                if after == size and not whole:
                    break
                if at_boundary(data, after):
                    self.unknown += 1
                    if self._returns_unknown:
                        found.append(frame)
                    at = after
                    continue
            if data[at] in _MARKERS:
                self.bad += 1
            following = STARTS.search(data, at + 1)
            resume = size if following is None else following.start()
            self.skipped_bytes += resume - at
            at = resume
        self.rest = data[at:]
        self.frames += sum(frame.known for frame in found)
        return found
