"""Frames of a log arrive at their times."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.tlog.log import TlogWriter
from tests.mavlink_bridge.link_pairs import frame

EPOCH = 1_700_000_000_000_000


def write_log(path: Path, offsets: list[int]) -> str:
    with TlogWriter(path) as writer:
        for number, offset in enumerate(offsets):
            writer.write(EPOCH + offset, number % 4, frame(number))
    return f"tlog:{path}"


@given(st.lists(st.integers(0, 10**7), min_size=1, max_size=30), st.lists(st.integers(0, 10**6), max_size=30))
@settings(max_examples=40)
def test_a_log_arrives_at_its_times(
    tmp_path_factory: pytest.TempPathFactory, offsets: list[int], waits: list[int]
) -> None:
    clock = SimulatedClock(5_000)
    link = open_link(write_log(tmp_path_factory.mktemp("log") / "a.tlog", offsets), clock)
    assert link.fileno() is None
    times = [offset & ~3 for offset in offsets]
    latest = [max(times[: k + 1]) - times[0] for k in range(len(times))]
    found: list[bytes] = []
    for pause in [0, *waits, 10**8]:
        clock.wait_until(clock.now() + pause)
        found += link.receive()
        assert len(found) == sum(time <= clock.now() - 5_000 for time in latest)
    assert found == [frame(number) for number in range(len(offsets))]
    link.send(frame(1))
    assert link.counters == (len(offsets), 0, 1)
    link.close()


def test_a_closed_log_says_nothing_more(tmp_path: Path) -> None:
    clock = SimulatedClock()
    link = open_link(write_log(tmp_path / "a.tlog", [0, 1000, 2000]), clock)
    assert link.receive() == [frame(0)]
    link.close()
    clock.wait_until(10_000)
    assert link.receive() == []
    link.close()
