"""Laws of the healthy stretch: it is what one finds frame by frame, and where it is cut does not matter."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.tlog import log as tlog
from mavlink_bridge.tlog.log import Record, read_tlog
from mavlink_bridge.tlog.stretch import leading_records
from mavlink_bridge.wire.framing import Flaw, frame_at
from tests.mavlink_bridge.recorded_logs import PIECES

LOGS = [path.read_bytes() for path in PIECES]


def one_by_one(data: bytes, at: int) -> tuple[list[Record], int]:
    """The records from ``at`` on by the frame that each must hold, and where they end."""
    found = []
    while not isinstance(frame := frame_at(data, at + 8), Flaw) and frame.known:
        stamp = int.from_bytes(data[at : at + 8], "big")
        if stamp >= 1 << 63:
            break
        found.append(Record(stamp & ~3, stamp & 3, frame.data))
        at += 8 + len(frame.data)
    return found, at


@given(
    st.sampled_from(LOGS),
    st.floats(0.0, 1.0, exclude_max=True),
    st.lists(st.tuples(st.integers(0, 2000), st.integers(1, 255)), max_size=3),
    st.integers(0, 2**63 - 1),
    st.integers(0, 4000),
)
def test_it_is_what_one_finds_frame_by_frame(
    data: bytes, cut: float, flips: list[tuple[int, int]], before: int, length: int
) -> None:
    """Whole, damaged, from within a record, and cut off anywhere."""
    first = int(cut * len(data))
    piece = bytearray(data[first : first + length])
    for at, bits in flips:
        if at < len(piece):
            piece[at] ^= bits
    for start in range(min(60, len(piece) + 1)):
        found = leading_records(bytes(piece), start, before)
        assert (found.records, found.end) == one_by_one(bytes(piece), start)
        times = [before, *(record.time for record in found.records)]
        assert found.time_steps_back == sum(later < earlier for earlier, later in pairwise(times))


@pytest.mark.parametrize("path", PIECES, ids=lambda path: path.stem)
def test_how_much_is_read_at_a_time_does_not_matter(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor do links: records of one time on several links are in order."""
    log = read_tlog(path)
    expected = list(log), log.report
    for size in (1, 13, 300, 5_000):
        monkeypatch.setattr(tlog, "_CHUNK", size)
        again = read_tlog(path)
        assert (list(again), again.report) == expected


def test_one_time_on_several_links_is_no_step_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    random = Random(1)
    frames = [record.frame for record in read_tlog(PIECES[0])]
    path = tmp_path / "links.tlog"
    with tlog.TlogWriter(path) as writer:
        for number, frame in enumerate(frames):
            writer.write(4 * (number // 7), random.randrange(4), frame)
    for size in (40, 1 << 15):
        monkeypatch.setattr(tlog, "_CHUNK", size)
        log = read_tlog(path)
        assert sum(1 for _ in log) == len(frames)
        assert log.report.time_steps_back == 0
