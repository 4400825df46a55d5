"""Codec from bytes to messages and back, without I/O.

Bytes from outside never raise; dropped frames are counted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache
from types import EllipsisType
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.errors import EncodeError
from mavlink_bridge.messages import BY_ID, BY_TYPE, Converter, Message, Source, StatusText
from mavlink_bridge.messages.status import TEXT_LENGTH, text_chunks
from mavlink_bridge.wire.framing import (
    MAX_CACHED_BYTES,
    Frame,
    Framer,
    frame_v1,
    frame_v2,
    leading_frames,
)
from mavlink_bridge.wire.signing import Signing

Accept = Callable[[int, int, int], bool]


class _Received:
    """Frame with its message: None if a value is invalid, ``...`` until a receiver has accepted the frame."""

    __slots__ = ("component", "declared", "frame", "message", "message_id", "system")

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        self.message_id, self.system, self.component = frame.message_id, frame.system, frame.component
        self.declared = frame.message_id in BY_ID
        self.message: Message | EllipsisType | None = ...

    def decode(self) -> Message | None:
        """Decode the payload, once for all receivers of the frame in this process."""
        source = Source(self.system, self.component)
        self.message = message = BY_ID[self.message_id].parse(source, self.frame.payload)
        return message


@lru_cache(maxsize=1024)
def _contents(data: bytes) -> tuple[_Received, ...] | None:
    """Return the frames of a datagram; None if it holds anything else."""
    frames, end = leading_frames(data)
    return tuple(map(_Received, frames)) if end == len(data) else None


class Counters(NamedTuple):
    """Statistics of the bytes fed so far.

    - ``good``: frames that were decoded to messages
    - ``bad``: false starts, wrong checksums, invalid values
    - ``unknown``: frames with message ids that the dialect lacks, or with unknown incompatibility flags
    - ``filtered``: valid frames that ``accept`` rejected, or of a message that ``messages`` lacks
    - ``skipped_bytes``: bytes that belong to no frame
    - ``refused``: frames that ``accept`` passed and ``signing`` refused
    """

    good: int
    bad: int
    unknown: int
    filtered: int
    skipped_bytes: int
    refused: int


class Codec:
    """Decoder and encoder of one link.

    ``accept(message_id, system, component)`` is called after the checksum test and before the payload is
    decoded; None accepts everything. Accepted frames are then checked by ``signing``, which also signs
    outgoing frames with link id ``link``. Without ``signing``, signatures are ignored.
    """

    def __init__(self, accept: Accept | None = None, signing: Signing | None = None, link: int = 0) -> None:
        self._accept = accept
        self._signing = signing
        self._link = link
        self._framer = Framer()
        self._good = 0
        self._bad = 0
        self._filtered = 0
        self._refused = 0
        self._sequences: dict[Source, int] = {}

    @property
    def counters(self) -> Counters:
        """Counts of everything fed so far."""
        framer = self._framer
        return Counters(
            self._good,
            self._bad + framer.bad,
            framer.unknown,
            self._filtered,
            framer.skipped_bytes,
            self._refused,
        )

    @property
    def pending_bytes(self) -> int:
        """Number of bytes of a frame that is not complete yet (at most 288)."""
        return self._framer.pending_bytes

    def feed(self, data: bytes, *, whole: bool = False) -> list[Message]:
        """Return the messages that ``data`` completes, in order; never raise.

        A partial frame waits for its rest. With ``whole`` it is dropped instead: in datagrams of several
        senders no rest follows, and the partial frame would delay the data of the next sender.

        A NaN or infinity drops a message declared as ``finite``, or whose ``decode`` rejects it (both counted
        as bad). Other messages keep it, as it may mean *ignored* or *unknown*: commands, set-points and their
        echo, mission items, altitude, home, estimator reports.
        """
        accept, signing = self._accept, self._signing
        contents: Iterable[_Received] | None = None
        # A bytearray may change, and may not be hashed.
        if type(data) is bytes and len(data) <= MAX_CACHED_BYTES and not self._framer.rest:
            contents = _contents(data)
        if contents is None:
            contents = map(_Received, self._framer.feed(data, whole=whole))
        found: list[Message] = []
        for one in contents:
            if not one.declared or (
                accept is not None and not accept(one.message_id, one.system, one.component)
            ):
                self._filtered += 1
                continue
            if signing is not None and signing.check(one.frame) is not None:
                self._refused += 1
                continue
            message = one.message
            if message is ...:
                message = one.decode()
            if message is None:
                self._bad += 1
            else:
                found.append(message)
        self._good += len(found)
        return found

    def encode(self, message: Message) -> bytes:
        """Encode ``message`` as MAVLink 2 frames from ``message.source``.

        Returns one frame, or several for a StatusText above 50 characters. Raises EncodeError, with field and
        value, for a value that does not fit, or that is not finite in a message declared as ``finite``.
        """
        row = BY_TYPE[type(message)]
        if isinstance(message, StatusText) and len(message.text) > TEXT_LENGTH:
            return self._encode_long(row, message)
        return self._frame(row, message.source, row.pack(message))

    def encode_v1(self, message: Message) -> bytes:
        """Encode ``message`` in MAVLink 1, without signature and without extension fields.

        A StatusText is cut at 50 characters. Raises EncodeError as ``encode`` does, and also for message ids
        above 255.
        """
        row = BY_TYPE[type(message)]
        if row.id > 255:
            raise EncodeError(f"{row.name}: message id = {row.id} does not exist in MAVLink 1")
        payload = row.pack(message)[: row.size_v1]
        return frame_v1(row.id, row.crc_extra, message.source, self._next(message.source), payload)

    def _encode_long(self, row: Converter, message: StatusText) -> bytes:
        # STATUSTEXT.id identifies the chunks of one text; zero means a text of one chunk.
        text_id = self._sequences.get(message.source, 0) + 1
        pieces = [
            row.struct.pack(message.severity, piece, text_id, number)
            for number, piece in enumerate(text_chunks(message.text))
        ]
        return b"".join(self._frame(row, message.source, piece) for piece in pieces)

    def _frame(self, row: Converter, source: Source, payload: bytes) -> bytes:
        signing, number = self._signing, self._next(source)
        if signing is None or signing.key is None:
            return frame_v2(row.id, row.crc_extra, source, number, payload)
        frame = frame_v2(row.id, row.crc_extra, source, number, payload, mavlink.MAVLINK_IFLAG_SIGNED)
        return signing.sign(frame, self._link)

    def _next(self, source: Source) -> int:
        sequence = self._sequences.get(source)
        if sequence is None:
            if not (0 <= source[0] <= 255 and 0 <= source[1] <= 255):
                raise EncodeError(f"source = {tuple(source)} is outside 0…255")
            sequence = 0
        self._sequences[source] = (sequence + 1) & 0xFF
        return sequence
