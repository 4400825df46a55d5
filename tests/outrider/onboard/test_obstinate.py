"""Disks that are full and terminals that stand still hold up no flight."""

from __future__ import annotations

import json
import os
import pty
import signal
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from typing import IO, cast

import pytest
from rich.console import Console

from mavlink_bridge.messages import Heartbeat, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.onboard.child_process import EXIT_TIMEOUT_S, KILL_TIMEOUT_S, ChildProcess
from outrider.onboard.event_log import EventLog
from outrider.onboard.log import BATCH, MAX_BATCHES, Log
from outrider.onboard.terminal import Terminal
from outrider.onboard.worker import Worker
from outrider.runs.steps_file import read_steps

BEAT = Datagram("autopilot", Codec().encode(Heartbeat(Source(1, 1), 2, 3, 0, 0, 3)))


def written(directory: Path, count: int = 5_000) -> list[str]:
    """What is said of a log of so many steps."""
    said: list[str] = []
    with Log(directory, 1, said.append, timeout_s=60.0) as log:
        recorded(log, count)
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


def recorded(log: Log, count: int) -> None:
    """So many steps, each with one message."""
    for k in range(count):
        log.begin(10_000 * k, "companion-1")
        log(10_000 * k, "companion-1", "in", [BEAT])


def test_a_disk_that_stands_still_is_not_waited_for(tmp_path: Path, patience: None) -> None:
    """A pipe that nobody reads: not even opening it comes to an end."""
    os.mkfifo(tmp_path / "vehicle-1.tlog")
    said: list[str] = []
    log = Log(tmp_path, 1, said.append, timeout_s=0.0)
    with log:
        recorded(log, 100)
        assert said == []
        recorded(log, BATCH * MAX_BATCHES)
        assert said == ["no log from here on: the disk does not respond"]
        # Nothing more is kept for it.
        assert log._waiting.qsize() <= MAX_BATCHES + 1
    assert len(said) == 1
    assert read_late(tmp_path / "vehicle-1.tlog")


def test_a_disk_that_stood_still_for_a_while_has_all(tmp_path: Path, patience: None) -> None:
    assert written(tmp_path / "whole") == []
    os.mkfifo(tmp_path / "vehicle-1.tlog")
    said: list[str] = []
    found: list[bytes] = []
    late = Thread(target=lambda: found.append(read_late(tmp_path / "vehicle-1.tlog")))
    with Log(tmp_path, 1, said.append, timeout_s=60.0) as log:
        recorded(log, 5_000)
        late.start()
    late.join()
    assert said == []
    assert found == [(tmp_path / "whole" / "vehicle-1.tlog").read_bytes()]
    steps = read_steps(tmp_path / "vehicle-1.steps.npz")
    assert (steps == read_steps(tmp_path / "whole" / "vehicle-1.steps.npz")).all()


def test_what_the_end_does_not_wait_for_is_said(tmp_path: Path, patience: None) -> None:
    os.mkfifo(tmp_path / "vehicle-1.tlog")
    said: list[str] = []
    with Log(tmp_path, 1, said.append, timeout_s=0.0) as log:
        recorded(log, 100)
    assert said == ["no log from here on: the disk does not respond"]
    assert read_late(tmp_path / "vehicle-1.tlog")


def read_late(path: Path) -> bytes:
    """A pipe that is read after all, until its writer has closed it."""
    return path.read_bytes()


def test_a_process_that_cannot_be_killed_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It waits for a disk in the kernel: the vehicle has to be told to hold all the same."""
    done: list[object] = []

    class Stuck:
        def kill(self) -> None:
            done.append("killed")

        def join(self, seconds: float) -> None:
            done.append(seconds)

        def is_alive(self) -> bool:
            return True

    child = ChildProcess(cast(Worker, SimpleNamespace(main=None)))
    monkeypatch.setattr(child, "_process", Stuck())
    child.kill()
    child.join()
    assert done == ["killed", KILL_TIMEOUT_S]
    # Nor where it had time to end by itself.
    done.clear()
    child = ChildProcess(cast(Worker, SimpleNamespace(main=None)))
    monkeypatch.setattr(child, "_process", Stuck())
    child.join()
    assert done == [EXIT_TIMEOUT_S, "killed", KILL_TIMEOUT_S]


def test_who_does_not_listen_ends_nothing(tmp_path: Path) -> None:
    """A pipe whose reader has gone."""

    def gone(_line: str) -> None:
        raise BrokenPipeError

    event_log = EventLog(tmp_path, lambda: 1.0)
    event_log.tell = gone
    event_log.note("phase", "escort")
    event_log.close()
    assert "escort" in (tmp_path / "events.jsonl").read_text(encoding="utf-8")


def test_a_disk_that_stands_still_keeps_nobody_from_noting_what_happens(
    tmp_path: Path, patience: None
) -> None:
    """A pipe that nobody reads for a while."""
    place = tmp_path / "events.jsonl"
    os.mkfifo(place)
    reader = os.open(place, os.O_RDONLY | os.O_NONBLOCK)
    event_log = EventLog(tmp_path, lambda: 1.0)
    for number in range(3000):
        event_log.note("autopilot", f"{number:0100}")
    os.set_blocking(reader, True)
    found: list[bytes] = []

    def read() -> None:
        found.extend(iter(lambda: os.read(reader, 65536), b""))

    listening = Thread(target=read)
    listening.start()
    event_log.close()
    listening.join()
    os.close(reader)
    lines = [json.loads(line)["text"] for line in b"".join(found).splitlines()]
    assert lines == [f"{number:0100}" for number in range(3000)]


@pytest.fixture
def patience() -> Iterator[None]:
    """Whoever waits here would wait for ever."""
    before = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("it waits"))
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def test_a_terminal_that_is_gone_is_drawn_on_no_more(patience: None) -> None:
    """Whoever it was is not told by a signal; what was refused is not kept."""
    far, near = pty.openpty()
    terminal = Terminal(near)
    console = Console(file=cast(IO[str], terminal))
    console.print("begin")
    assert os.read(far, 100).startswith(b"begin")
    os.close(far)
    for _ in range(100):
        console.print("a picture")
        assert not console._buffer
    assert not terminal.takes
    terminal.close()
    os.close(near)


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
