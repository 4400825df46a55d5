"""Reader and writer of tlog files.

Each record is a time (µs, 8 bytes big endian, with the link in the low 2 bits) and a frame as it was on the
wire.

Logs of real flights may be damaged. The reader accepts a frame if its checksum is correct. It steps over a
damaged record by the length in its header if a plausible record follows there; otherwise it searches for the
next valid frame. A stamp of 2⁶³ µs and more is damage: its frame gets the time of the record before. It
reads undamaged records many at a time (``stretch``).
"""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing
from functools import lru_cache
from io import BufferedIOBase, BufferedReader
from pathlib import Path
from struct import Struct
from types import TracebackType
from typing import NamedTuple, Self

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.errors import LogError
from mavlink_bridge.tlog.stretch import IMPOSSIBLE, Record, Stretch, leading_records
from mavlink_bridge.wire.framing import (
    LONGEST_FRAME,
    MAX_CACHED_BYTES,
    STARTS,
    Flaw,
    Frame,
    at_boundary,
    claimed_length,
    frame_at,
    leading_frames,
    skipped_to,
    without_signature,
)

__all__ = ["LINKS", "PLAUSIBLE_JUMP", "Record", "TlogReader", "TlogReport", "TlogWriter", "read_tlog"]

LINKS = 4
"""Number of links that a stamp can distinguish."""
PLAUSIBLE_JUMP = 86_400_000_000
"""µs. Next to damage a stamp is accepted only if it differs from the previous one by at most a day."""

_STAMP = Struct(">Q")
_CHUNK = 1 << 15
# A record, the stamp after it and the start byte behind that: the bytes needed to judge a record.
_LOOK_AHEAD_BYTES = 8 + LONGEST_FRAME + 8 + 1


class TlogReport(NamedTuple):
    """Statistics of one pass.

    - ``good``: records with a correct checksum
    - ``bad``: records with a wrong checksum, or stretches of bytes that are no record
    - ``unknown``: records of messages that the dialect lacks, or with unknown incompatibility flags, at
      plausible places; they are not returned
    - ``skipped_bytes``: bytes in no good or unknown record
    - ``time_steps_back``: records with a time before that of the previous record
    - ``truncated``: the log ends within a record, or its compression breaks off
    """

    good: int
    bad: int
    unknown: int
    skipped_bytes: int
    time_steps_back: int
    truncated: bool


class TlogWriter:
    """Writer of a tlog, compressed if ``path`` ends in ``.gz``; a context manager.

    The same records give the same bytes. Logs are passed on to others and must not contain secrets:
    signatures are removed, because many of them allow a search for a weak key, and SETUP_SIGNING, which holds
    a key, is left out and counted in ``withheld``. Raises LogError if the file cannot be created.
    """

    def __init__(self, path: Path | str) -> None:
        self.records = 0
        self.withheld = 0
        self.skipped_bytes = 0
        self._gzip: gzip.GzipFile | None = None
        try:
            self._file = Path(path).open("wb")  # noqa: SIM115
        except OSError as error:
            raise LogError(f"{path}: cannot be written: {error.strerror}") from None
        if str(path).endswith(".gz"):
            self._gzip = gzip.GzipFile("", "wb", fileobj=self._file, mtime=0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Finish the file; calling it again is harmless."""
        if self._gzip is not None:
            self._gzip.close()
        self._file.close()

    def write(self, time_us: int, link: int, data: bytes) -> None:
        """Write one record for each frame of a datagram; the link replaces the low 2 bits of the time.

        Bytes that are no frame are left out and counted in ``skipped_bytes``. Raises LogError for a link
        outside 0…3 and for a time that does not fit.
        """
        self.write_all(time_us, [(link, data)])

    def write_all(self, time_us: int, datagrams: Iterable[tuple[int, bytes]]) -> None:
        """Write the records of several datagrams of one time, each with its link, as ``write`` does."""
        if not 0 <= time_us < IMPOSSIBLE:
            raise LogError(f"time {time_us} µs: not in a tlog's range")
        stamps = [_STAMP.pack(time_us & ~3 | link) for link in range(LINKS)]
        records = []
        for link, data in datagrams:
            if not 0 <= link < LINKS:
                raise LogError(f"link {link}: not in a tlog's range")
            # Several logs of one process may record the same datagram.
            short = type(data) is bytes and len(data) <= MAX_CACHED_BYTES
            frames, withheld, at = _leading(data) if short else _leading.__wrapped__(data)
            records.append(stamps[link].join(frames))
            self.records += len(frames) - 1
            if withheld or at < len(data):
                self.withheld += withheld
                records.extend(self._search(stamps[link], data, at))
        (self._file if self._gzip is None else self._gzip).write(b"".join(records))

    def _search(self, stamp: bytes, data: bytes, at: int) -> Iterator[bytes]:
        """Yield the records of ``data`` from ``at`` on, where an irregularity begins."""
        while at < len(data):
            frame = frame_at(data, at)
            if isinstance(frame, Flaw) or not (frame.known or at_boundary(data, at + len(frame.data))):
                foreign = frame is Flaw.INCOMPATIBLE
                end = skipped_to(data, at, whole=True) if foreign else Flaw.FALSE_START
                after = at + 1 if isinstance(end, Flaw) else end
                self.skipped_bytes += after - at
                at = after
                continue
            at += len(frame.data)
            recorded = _recorded(frame)
            if recorded is None:
                self.withheld += 1
                continue
            self.records += 1
            yield stamp + recorded


def _recorded(frame: Frame) -> bytes | None:
    """Return the bytes of a frame in a log, without a signature; None for SETUP_SIGNING."""
    if frame.message_id == mavlink.MAVLINK_MSG_ID_SETUP_SIGNING:
        return None
    return without_signature(frame.data) if frame.signed else frame.data


@lru_cache(maxsize=1024)
def _leading(data: bytes) -> tuple[tuple[bytes, ...], int, int]:
    """Return the ``leading_frames`` of ``data`` as recorded, after an empty one: a stamp precedes each frame.

    Also returned are the number of frames that are left out, and where the frames end.
    """
    frames, at = leading_frames(data)
    recorded = [part for frame in frames if (part := _recorded(frame)) is not None]
    return (b"", *recorded), len(frames) - len(recorded), at


def _is_gzip(head: bytes) -> bool:
    """Return whether ``head`` is the beginning of gzip data; garbage may have the magic bytes by chance."""
    if not head.startswith(b"\x1f\x8b\x08"):
        return False
    try:
        zlib.decompressobj(wbits=31).decompress(head)
    except zlib.error:
        return False
    return True


class TlogReader:
    """Records of a log, in the order of the file.

    Each iteration reads the file again, in bounded memory. Raises LogError if it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._pass: _Pass | None = None

    def __iter__(self) -> Generator[Record, None, None]:
        try:
            with self.path.open("rb") as raw:
                compressed = _is_gzip(raw.peek(_CHUNK))
                self._pass = _Pass(raw, gzip.GzipFile(fileobj=raw) if compressed else raw)
                yield from self._pass.records()
        except OSError as error:
            raise LogError(f"{self.path}: cannot be read: {error.strerror}") from None

    @property
    def report(self) -> TlogReport:
        """Statistics of the latest iteration so far.

        They may include some thousand records that are not returned yet.
        """
        if self._pass is None:
            return TlogReport(0, 0, 0, 0, 0, False)
        current = self._pass
        return TlogReport(
            current.good,
            current.bad,
            current.unknown,
            current.skipped_bytes,
            current.time_steps_back,
            current.truncated,
        )

    @property
    def bytes_read(self) -> int:
        """Bytes of the file, as stored, that the latest iteration has read."""
        return 0 if self._pass is None else self._pass.bytes_read

    @property
    def record_bytes(self) -> int:
        """Unpacked bytes of good and unknown records with their stamps, in the latest iteration so far.

        At its end the sum of ``record_bytes`` and ``skipped_bytes`` is the length of the log.
        """
        return 0 if self._pass is None else self._pass.record_bytes


def read_tlog(path: Path | str) -> TlogReader:
    """Open the log at ``path``, plain or gzip.

    Raises LogError if it is missing, unreadable or without MAVLink.
    """
    reader = TlogReader(Path(path))
    with closing(iter(reader)) as records:
        first = next(records, None)
    if first is None:
        raise LogError(f"{path}: holds no MAVLink frame")
    return reader


class _Pass:
    """One pass over the file: a window of bytes that slides along it, and the counts."""

    def __init__(self, file: BufferedReader, stream: BufferedIOBase) -> None:
        self.good = self.bad = self.unknown = self.skipped_bytes = self.time_steps_back = 0
        self.bytes_read = self.record_bytes = 0
        self.truncated = False
        self._file = file
        self._stream = stream
        self._window = b""
        self._at = 0
        self._ended = False
        self._stamp: int | None = None

    def records(self) -> Iterator[Record]:
        """Yield every record with a correct checksum."""
        while self._fill():
            stretch = leading_records(self._window, self._at, (self._stamp or 0) & ~3)
            if stretch.records:
                self._advance(stretch)
                yield from stretch.records
                continue
            frame = frame_at(self._window, self._at + 8)
            intact = frame is Flaw.INCOMPATIBLE or not isinstance(frame, Flaw)
            if not self._step_over(unknown_message=intact):
                record = self._search(cut=frame is Flaw.PARTIAL)
                if record is not None:
                    yield record

    def _fill(self) -> bool:
        """Load into the window the bytes needed to judge the current record; return False at the end.

        The 8 bytes before it are kept: they may be a stamp, if a search finds a frame here.
        """
        while len(self._window) - self._at < _LOOK_AHEAD_BYTES and not self._ended:
            try:
                # Not read(): if a compressed stream breaks off, only read1() returns the bytes before that.
                chunk = self._stream.read1(_CHUNK)
            except (EOFError, zlib.error, gzip.BadGzipFile):
                chunk = b""
                self.truncated = True
            self._ended = not chunk
            self.bytes_read = self._file.tell()
            done = max(self._at - 8, 0)
            self._window = self._window[done:] + chunk
            self._at -= done
        return self._at < len(self._window)

    def _advance(self, stretch: Stretch) -> None:
        """Count the records of ``stretch`` and continue behind it."""
        last = stretch.records[-1]
        self.good += len(stretch.records)
        self.time_steps_back += stretch.time_steps_back
        self.record_bytes += stretch.end - self._at
        self._stamp = last.time | last.link
        self._at = stretch.end

    def _record(self, stamp: int, data: bytes) -> Record:
        before, self._stamp = self._stamp, stamp
        if before is not None and stamp & ~3 < before & ~3:
            self.time_steps_back += 1
        self.good += 1
        return Record(stamp & ~3, stamp & 3, data)

    def _plausible(self, at: int, reference: int | None) -> bool:
        (stamp,) = _STAMP.unpack_from(self._window, at)
        if stamp >= IMPOSSIBLE:
            return False
        return reference is None or bool(abs(stamp - reference) <= PLAUSIBLE_JUMP)

    def _step_over(self, *, unknown_message: bool) -> bool:
        """Step over an unverified record by the length in its header; return whether that was possible.

        Its stamp must be plausible, and a plausible record or the end of the log must follow it.
        ``unknown_message``: the dialect lacks the message id, and the header has no fault.
        """
        length = claimed_length(self._window, self._at + 8)
        if length is None:
            return False
        end = self._at + 8 + length
        (own,) = _STAMP.unpack_from(self._window, self._at)
        if not self._plausible(self._at, self._stamp):
            return False
        if end != len(self._window) and not (
            STARTS.match(self._window, end + 8) is not None and self._plausible(end, own)
        ):
            return False
        if unknown_message:
            self.unknown += 1
            self.record_bytes += 8 + length
        else:
            self.bad += 1
            self.skipped_bytes += 8 + length
        self._at = end
        return True

    def _search(self, *, cut: bool) -> Record | None:
        """Continue behind the next frame with a correct checksum; return its record, or None.

        The 8 bytes before the frame are its stamp if they were skipped and are plausible; otherwise it gets
        the last stamp (0 if there is none). ``cut``: the end of the file may cut off the current record.
        """
        skipped = 0
        while self._fill():
            start = STARTS.search(self._window, self._at)
            resume = len(self._window) if start is None else start.start()
            skipped += resume - self._at
            self._at = resume
            if start is None or not self._fill():
                continue
            frame = frame_at(self._window, self._at)
            if isinstance(frame, Flaw) or not frame.known:
                self._at += 1
                skipped += 1
                continue
            stamp = self._stamp or 0
            if skipped >= 8 and self._plausible(self._at - 8, self._stamp):
                (stamp,) = _STAMP.unpack_from(self._window, self._at - 8)
                skipped -= 8
                self.record_bytes += 8
            self.bad += skipped > 0
            self.skipped_bytes += skipped
            self.record_bytes += len(frame.data)
            self._at += len(frame.data)
            return self._record(stamp, frame.data)
        self.skipped_bytes += skipped
        if cut:
            self.truncated = True
        else:
            self.bad += 1
        return None
