"""Disks that are full and terminals that stand still hold up no flight."""

from __future__ import annotations

import os
import pty
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from mavlink_bridge.codec import Codec
from mavlink_bridge.messages import Heartbeat, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.tlog import read_tlog
from outrider.aboard.diary import Diary
from outrider.aboard.log import Log
from outrider.aboard.terminal import Terminal

BEAT = Datagram("autopilot", Codec().encode(Heartbeat(Source(1, 1), 2, 3, 0, 0, 3)))


def written(directory: Path, count: int = 5_000) -> list[str]:
    """What is said of a log of so many steps."""
    said: list[str] = []
    with Log(directory, 1, said.append) as log:
        for k in range(count):
            log.begin(10_000 * k, "companion-1")
            log(10_000 * k, "companion-1", "in", BEAT)
    return said


def test_a_log_is_whole_where_there_is_room(tmp_path: Path) -> None:
    assert written(tmp_path / "new") == []
    assert len(list(read_tlog(tmp_path / "new" / "vehicle-1.tlog"))) == 5_000


@pytest.mark.parametrize("file", ["vehicle-1.tlog", "vehicle-1.steps.npz"])
@pytest.mark.parametrize("count", [1, 5_000])
def test_a_full_disk_ends_the_log_and_says_so_once(tmp_path: Path, file: str, count: int) -> None:
    (tmp_path / file).symlink_to("/dev/full")
    (said,) = written(tmp_path, count)
    assert "No space left" in said


def test_without_a_place_there_is_no_log(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert len(written(tmp_path / "file" / "below")) == 1


def test_who_does_not_listen_ends_nothing(tmp_path: Path) -> None:
    """A pipe whose reader has gone."""

    def gone(_line: str) -> None:
        raise BrokenPipeError

    diary = Diary(tmp_path, lambda: 1.0)
    diary.tell = gone
    diary.note("phase", "escort")
    diary.close()
    assert "escort" in (tmp_path / "events.jsonl").read_text(encoding="utf-8")


@pytest.fixture
def patience() -> Iterator[None]:
    """Whoever waits here would wait for ever."""
    before = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("it waits"))
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def test_a_terminal_that_stands_still_is_not_waited_for(patience: None) -> None:
    far, near = pty.openpty()
    terminal = Terminal(near)
    terminal.write("begin\n")
    assert os.read(far, 100).startswith(b"begin")
    for _ in range(100):
        terminal.write("a picture of two thousand letters\n" * 60)
    assert not terminal.takes
    # The file that the shell has as well still waits, as it should.
    assert os.get_blocking(near)
    terminal.close()
    os.close(near)
    os.close(far)
