"""Laws of tlogs: what is written is read, damage costs what it touches, and nothing but LogError comes
out."""

from __future__ import annotations

import gzip
import struct
import tracemalloc
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from mavlink_bridge.errors import LogError
from mavlink_bridge.messages import Heartbeat, Source, StatusText
from mavlink_bridge.tlog.log import Record, TlogReport, TlogWriter, read_tlog
from mavlink_bridge.wire.codec import Codec
from tests.mavlink_bridge.damage import damaged

NOW = 1_700_000_000_000_000
ME = Source(11, 1)


def frame(number: int, version: int = 2) -> bytes:
    codec = Codec()
    message = Heartbeat(ME, 2, 3, 81, number, 4)
    return codec.encode_v1(message) if version == 1 else codec.encode(message)


def stamped(time: int, data: bytes) -> bytes:
    return struct.pack(">Q", time) + data


def read(data: bytes, name: str = "flight.tlog") -> tuple[list[Record], TlogReport]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(data)
        reader = read_tlog(path)
        return list(reader), reader.report


PLAIN = [(NOW + 4000 * index, frame(index, 1 + index % 2)) for index in range(40)]


def whole(records: list[tuple[int, bytes]] = PLAIN) -> bytes:
    return b"".join(stamped(time, data) for time, data in records)


datagrams = st.lists(
    st.tuples(
        st.integers(0, 2**63 - 1),
        st.integers(0, 3),
        st.lists(st.integers(0, 1000), min_size=1, max_size=3),
    ),
    min_size=1,
    max_size=12,
)


@given(datagrams, st.sampled_from(["flight.tlog", "flight.tlog.gz"]))
@settings(max_examples=40)
def test_what_is_written_is_read(sent: list[tuple[int, int, list[int]]], name: str) -> None:
    expected = [Record(time & ~3, link, frame(number)) for time, link, numbers in sent for number in numbers]
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        with TlogWriter(path) as writer:
            for time, link, numbers in sent:
                writer.write(time, link, b"".join(map(frame, numbers)))
        reader = read_tlog(str(path))
        assert list(reader) == expected
        assert list(reader) == expected
        times = [record.time for record in expected]
        back = sum(later < earlier for earlier, later in pairwise(times))
        assert reader.report == (len(expected), 0, 0, 0, back, False)
        assert (path.read_bytes()[:2] == b"\x1f\x8b") == name.endswith(".gz")


def test_the_layout_is_that_of_other_tools() -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.tlog"
        with TlogWriter(path) as writer:
            writer.write(NOW, 2, frame(1) + frame(2))
        assert path.read_bytes() == stamped(NOW + 2, frame(1)) + stamped(NOW + 2, frame(2))


def test_the_same_records_give_the_same_compressed_bytes() -> None:
    with TemporaryDirectory() as folder:
        paths = [Path(folder) / name for name in ("a.tlog.gz", "b.tlog.gz")]
        for path in paths:
            with TlogWriter(path) as writer:
                writer.write(NOW, 0, frame(1))
        assert paths[0].read_bytes() == paths[1].read_bytes()


def test_bytes_that_are_no_frame_are_not_written() -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.tlog"
        with TlogWriter(path) as writer:
            writer.write(NOW, 0, b"junk" + frame(1) + b"\xfd" + frame(2) + frame(3)[:-1])
        assert writer.records == 2
        assert writer.skipped_bytes == 4 + 1 + len(frame(3)) - 1
        assert [record.frame for record in read_tlog(path)] == [frame(1), frame(2)]


@pytest.mark.parametrize(("time", "link"), [(-1, 0), (2**63, 0), (0, 4), (0, -1)])
def test_a_record_that_does_not_fit_is_refused(time: int, link: int) -> None:
    with (
        TemporaryDirectory() as folder,
        TlogWriter(Path(folder) / "a.tlog") as writer,
        pytest.raises(LogError),
    ):
        writer.write(time, link, frame(1))


# Damage


def test_a_sound_log_is_read_whole() -> None:
    records, report = read(whole())
    assert [(record.time, record.frame) for record in records] == PLAIN
    assert report == (len(PLAIN), 0, 0, 0, 0, False)


def test_frames_that_share_a_stamp_share_the_time() -> None:
    records, report = read(stamped(NOW + 1, frame(1) + frame(2)) + stamped(NOW + 8, frame(3)))
    assert records == [Record(NOW, 1, frame(1)), Record(NOW, 1, frame(2)), Record(NOW + 8, 0, frame(3))]
    assert report == (3, 0, 0, 0, 0, False)


def test_well_placed_records_that_fail_their_checksum_count_one_each() -> None:
    broken = bytearray(frame(99))
    broken[-1] ^= 1
    data = whole(PLAIN[:3]) + stamped(NOW, bytes(broken)) * 2 + whole(PLAIN[3:])
    records, report = read(data)
    assert [record.frame for record in records] == [data for _, data in PLAIN]
    assert report == (len(PLAIN), 2, 0, 2 * (8 + len(broken)), 0, False)


def test_unknown_messages_are_counted_and_left_out() -> None:
    unknown = b"\xfd\x03\0\0\x01\x0b\x01\xef\xbe\xad" + b"abc" + b"\x12\x34"
    for data in (
        whole(PLAIN[:2]) + stamped(NOW + 4000, unknown) + whole(PLAIN[2:]),
        whole() + stamped(NOW + 4000 * 40, unknown),
        stamped(NOW - 4000, unknown) + whole(),
    ):
        records, report = read(data)
        assert [record.frame for record in records] == [data for _, data in PLAIN]
        assert report == (len(PLAIN), 0, 1, 0, 0, False)


def test_time_that_steps_back_is_kept_and_counted() -> None:
    times = [NOW, NOW + 8000, NOW + 4000, NOW + 12_000, NOW - 10**13]
    records, report = read(whole([(time, frame(1)) for time in times]))
    assert [record.time for record in records] == times
    assert report.time_steps_back == 2


@given(st.binary(min_size=1, max_size=300), st.integers(0, len(PLAIN)))
def test_garbage_between_records_costs_no_record(garbage: bytes, at: int) -> None:
    """It may look like the stamp or the start of a record, but never takes a good one with it."""
    records, report = read(whole(PLAIN[:at]) + garbage + whole(PLAIN[at:]))
    assert [(record.time, record.frame) for record in records] == PLAIN
    assert report[2:5] == (0, len(garbage), 0)
    assert report.bad + report.truncated == 1


@given(st.integers(0, len(whole()) - 1))
def test_a_truncated_log_keeps_all_whole_records(length: int) -> None:
    complete = 0
    end = 0
    for _, data in PLAIN:
        end += 8 + len(data)
        complete += end <= length
    if complete == 0:
        with pytest.raises(LogError):
            read(whole()[:length])
        return
    records, report = read(whole()[:length])
    assert len(records) == complete
    used = sum(8 + len(record.frame) for record in records)
    assert report == (complete, 0, 0, length - used, 0, length != used)


@given(st.data(), st.sampled_from(["flight.tlog", "flight.tlog.gz"]))
@settings(max_examples=150)
def test_mutated_logs_raise_nothing_but_log_error(data: st.DataObject, name: str) -> None:
    log = gzip.compress(whole(), mtime=0) if name.endswith(".gz") else whole()
    log = damaged(log, data, times=8, inserted=40, cut=100)
    try:
        records, report = read(log, name)
    except LogError:
        return
    assert report.good == len(records)
    if name == "flight.tlog":
        spent = sum(len(record.frame) for record in records) + report.skipped_bytes
        assert spent <= len(log)
        good = {data for _, data in PLAIN}
        assert all(record.frame in good for record in records)


@given(st.binary(max_size=600))
def test_any_bytes_are_a_log_or_a_log_error(data: bytes) -> None:
    try:
        records, report = read(data)
    except LogError:
        return
    assert report.good == len(records) > 0


def test_a_cut_compressed_log_gives_what_it_has() -> None:
    packed = gzip.compress(whole([(NOW + 4 * n, frame(n * 7919 % 2**32)) for n in range(3000)]))
    records, report = read(packed[: len(packed) // 2], "flight.tlog.gz")
    assert 0 < len(records) < 3000
    assert report.truncated


@pytest.mark.parametrize("content", [b"", b"hello", bytes(100_000)], ids=["empty", "text", "zeros"])
def test_a_file_without_mavlink_is_an_error_in_one_line(content: bytes) -> None:
    with pytest.raises(LogError, match=r"^[^\n]*no MAVLink[^\n]*$"):
        read(content)


def test_a_missing_log_or_a_folder_is_an_error_in_one_line() -> None:
    with TemporaryDirectory() as folder:
        for path in (Path(folder) / "none.tlog", Path(folder)):
            with pytest.raises(LogError, match=r"^[^\n]*cannot be read[^\n]*$"):
                read_tlog(path)
        with pytest.raises(LogError, match="cannot be written"):
            TlogWriter(Path(folder))


def test_memory_stays_bounded_whatever_the_length_and_the_garbage() -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "long.tlog"
        with path.open("wb") as file:
            file.write(whole())
            for _ in range(60):
                file.write(bytes(50_000) + whole())
        reader = read_tlog(path)
        tracemalloc.start()
        try:
            count = sum(1 for _ in reader)
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
    assert count == 61 * len(PLAIN)
    assert reader.report.skipped_bytes == 60 * 50_000
    assert peak < 1_000_000


def test_records_feed_a_codec() -> None:
    text = Codec().encode(
        StatusText(ME, 5, "a text that is so long that it needs several frames to be sent whole")
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.tlog"
        with TlogWriter(path) as writer:
            writer.write(NOW, 0, text)
        codec = Codec()
        messages = [message for record in read_tlog(path) for message in codec.feed(record.frame)]
    assert len(messages) == 2
    assert dialect.MAVLINK_MSG_ID_STATUSTEXT == 253


def test_no_log_of_ours_holds_a_signature_or_a_key() -> None:
    """Whoever gets the log could look for the key; and what remains is what was said."""
    key = bytes(range(1, 33))
    peer = dialect.MAVLink(None, *ME)
    peer.signing.secret_key, peer.signing.sign_outgoing = key, True
    setup = dialect.MAVLink_setup_signing_message(11, 1, list(key), 36_000_000_000_000)
    unknown = bytearray(dialect.MAVLink_vibration_message(1, 2, 3, 4, 5, 6, 7).pack(peer))
    unknown[7:10] = b"\xef\xbe\xad"
    signed = [dialect.MAVLink_heartbeat_message(2, 3, 81, number, 4, 3).pack(peer) for number in range(3)]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.tlog"
        with TlogWriter(path) as writer:
            writer.write(NOW, 0, signed[0] + setup.pack(peer) + signed[1])
            writer.write(NOW, 0, setup.pack(dialect.MAVLink(None)) + frame(7))
            writer.write(NOW, 0, b"?" + signed[2] + setup.pack(peer) + bytes(unknown))
            assert (writer.records, writer.withheld, writer.skipped_bytes) == (5, 3, 1)
        assert key not in path.read_bytes()
        found = [record.frame for record in read_tlog(path)]
        assert len(path.read_bytes()) == sum(8 + len(data) for data in found) + 8 + len(unknown) - 13
    assert all(data[2] == 0 for data in found)
    received = [dialect.MAVLink(None).decode(bytearray(data)) for data in found]
    assert [message.custom_mode for message in received] == [0, 1, 7, 2]


@given(impossible=st.sets(st.integers(0, 29), max_size=30), stamp=st.integers(1 << 63, (1 << 64) - 1))
def test_a_time_beyond_all_reason_is_damage_and_its_frame_is_kept(impossible, stamp):
    """Records of such a time have that of the record before them, 0 at the beginning."""
    codec = Codec()
    frames = [codec.encode(Heartbeat(Source(1, 1), 2, 3, 0, k, 4)) for k in range(30)]
    times = [4 * (1 << 40) + 4 * k for k in range(30)]
    stamps = [stamp if k in impossible else times[k] for k in range(30)]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "flight.tlog"
        path.write_bytes(b"".join(s.to_bytes(8, "big") + f for s, f in zip(stamps, frames, strict=True)))
        log = read_tlog(path)
        records = list(log)
    assert [record.frame for record in records] == frames
    expected, last = [], 0
    for k, time in enumerate(times):
        last = last if k in impossible else time
        expected.append(last)
    assert [record.time for record in records] == expected
    assert log.report.bad == len(impossible)
