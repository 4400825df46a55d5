"""What our reader counts is what pymavlink's counts.

*Good* is the same for both: the checksum holds. *Bad* is for us a record whose checksum fails, or a stretch
that is no record; pymavlink says BAD_DATA once for each frame that fails, and once for a run of bytes without
a start. Where damage leaves the lengths whole, as it does in the recorded logs, the two are the same number.
*Unknown* are frames of messages that the dialect lacks: nobody can verify them. *Skipped* are all bytes of
the file that are in no good or unknown record, stamps included: pymavlink does not count them, but what it
hands out tells them.
"""

from __future__ import annotations

import gzip
import struct
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink import mavutil

from mavlink_bridge.messages import Attitude, GlobalPosition, Heartbeat, Source
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Frame, frame_at
from tests.mavlink_bridge.recorded_logs import LOGS, PIECES

NOW = 1_700_000_000_000_000


class Count(NamedTuple):
    """Of a whole log; ``frames``: time (µs) and bytes of the good ones."""

    good: int
    bad: int
    unknown: int
    skipped_bytes: int
    frames: list[tuple[int, bytes]]


@pytest.fixture(autouse=True)
def version_2(monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise pymavlink begins as version 1 and may stay so."""
    monkeypatch.setenv("MAVLINK20", "1")


def by_pymavlink(path: Path) -> Count:
    """As mavutil reads it, to the end."""
    bad = unknown = taken = 0
    frames = []
    mavutil.set_dialect("all")
    # Not mavlink_connection(): its reader of whole logs breaks off where one is cut.
    log = mavutil.mavlogfile(str(path))
    try:
        while (message := log.recv_msg()) is not None:
            if message.get_type() == "BAD_DATA":
                bad += 1
                continue
            data = bytes(message.get_msgbuf())
            taken += 8 + len(data)
            if message.get_type().startswith("UNKNOWN_"):
                unknown += 1
            else:
                frames.append((round(message._timestamp * 1e6), data))
    finally:
        log.close()
    return Count(len(frames), bad, unknown, path.stat().st_size - taken, frames)


def agree(path: Path) -> Count:
    """Both readers agree on ``path``, record by record; what they count."""
    log = read_tlog(path)
    records = list(log)
    report, theirs = log.report, by_pymavlink(path)
    assert (report.good, report.bad, report.unknown, report.skipped_bytes) == theirs[:4]
    assert [record.frame for record in records] == [data for _, data in theirs.frames]
    assert all(abs(record.time - time) < 4 for record, (time, _) in zip(records, theirs.frames, strict=True))
    assert log.record_bytes + report.skipped_bytes == path.stat().st_size
    return theirs


@pytest.mark.parametrize("path", LOGS)
def test_a_recorded_log(path: Path) -> None:
    assert agree(path).good > 0


def test_the_pieces_hold_what_they_are_there_for() -> None:
    counts = {path.stem: agree(path)[:4] for path in PIECES}
    assert counts == {
        "copter-whole": (300, 0, 0, 0),
        "px4-unknown": (400, 0, 2, 0),
        "quadrotor-damaged": (700, 205, 0, 4324),
        "submarine-damaged": (700, 30, 0, 1260),
    }


@pytest.mark.parametrize("path", LOGS)
def test_compressed_it_is_the_same(path: Path, tmp_path: Path) -> None:
    packed = tmp_path / "log.tlog.gz"
    packed.write_bytes(gzip.compress(path.read_bytes(), 1))
    ours, plain = read_tlog(packed), read_tlog(path)
    assert list(ours) == list(plain)
    assert (ours.report, ours.record_bytes) == (plain.report, plain.record_bytes)
    assert (ours.bytes_read, plain.bytes_read) == (packed.stat().st_size, path.stat().st_size)


# Logs with any damage that leaves the lengths whole


def good(random: Random, version: int) -> bytes:
    """A frame of one of several vehicles; system 0 is one of them."""
    source = Source(random.choice((0, 1, 11, 255)), random.choice((1, 195)))
    message = random.choice(
        (
            Heartbeat(source, 2, 3, 81, random.getrandbits(32), 4),
            Attitude(source, 1000 * random.getrandbits(20), 0.1, -0.2, 3.0, (0.0, 0.1, random.random())),
            GlobalPosition(source, 0, 47.0, 8.0, 500.0, random.random(), (1.0, 2.0, 0.5), None),
        )
    )
    codec = Codec()
    return codec.encode_v1(message) if version == 1 else codec.encode(message)


def made(kind: str, random: Random) -> bytes:
    """A frame of the kind. A broken one keeps start, length and flags."""
    if kind in ("v1", "v2"):
        return good(random, int(kind[1]))
    if kind == "unknown":
        payload = random.randbytes(random.randint(1, 255))
        return struct.pack("<BBBB", 0xFD, len(payload), 0, 0) + b"\7\x0b\1\xef\xbe\xad" + payload + b"ab"
    data = bytearray(good(random, 2))
    if kind == "signed":
        return signed(bytes(data), random)
    at = random.randrange(10, len(data))
    data[at] ^= random.randint(1, 255)
    return bytes(data)


def signed(data: bytes, random: Random) -> bytes:
    """The version 2 frame ``data`` with a signature, which nobody checks, and the checksum that belongs to
    it."""
    from fastcrc.crc16 import mcrf4xx

    from mavlink_bridge.wire.framing import CRC_EXTRA

    frame = frame_at(data, 0)
    assert isinstance(frame, Frame)
    body = data[:2] + b"\1" + data[3:-2]
    checksum = mcrf4xx(body[1:] + CRC_EXTRA[frame.message_id])
    return body + checksum.to_bytes(2, "little") + random.randbytes(13)


@given(
    st.lists(st.sampled_from(["v1", "v2", "signed", "unknown", "broken"]), min_size=1, max_size=40),
    st.integers(0, 2**32),
    st.integers(0, 30),
)
@settings(max_examples=60)
def test_a_log_that_is_damaged_within_its_records(kinds: list[str], seed: int, tail: int) -> None:
    """Whatever order they come in, and with a last record that the end cuts off."""
    random = Random(seed)
    kinds = ["v2", *kinds, "v1"]
    frames = [made(kind, random) for kind in kinds]
    times = [NOW + random.randrange(10**9) for _ in frames]
    data = b"".join(struct.pack(">Q", time) + frame for time, frame in zip(times, frames, strict=True))
    last = struct.pack(">Q", NOW) + good(random, 1)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "made.tlog"
        path.write_bytes(data + last[: min(tail, len(last) - 1)])
        count = agree(path)
    assert count.good == sum(kind in ("v1", "v2", "signed") for kind in kinds)
    assert (count.bad, count.unknown) == (kinds.count("broken"), kinds.count("unknown"))
