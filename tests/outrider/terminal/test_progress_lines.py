"""Where nobody sees a bar a line is said now and then, and none for what is quick."""

from __future__ import annotations

import sys
from io import StringIO
from itertools import count

import pytest

from outrider.simulation.conductor import Stage
from outrider.simulation.console import progress
from outrider.terminal import progress_lines
from outrider.terminal.progress_lines import LINE_S
from outrider.terminal.share_progress import share_progress


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What it shows, s; and lines are said when it is time."""
    shown = [1000.0]
    monkeypatch.setattr(progress_lines, "LINE_S", LINE_S)
    monkeypatch.setattr(progress_lines.time, "monotonic", lambda: shown[0])
    return shown


def test_a_flight_says_where_it_is(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    with progress(60.0) as watch:
        for second in range(61):
            clock[0] = 1000.0 + second
            watch(Stage.CLOCK, 0.1 * second)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"flight: {0.1 * k * LINE_S:.1f} s simulated" for k in (1, 2, 3)]


def test_what_is_quick_says_nothing(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    with share_progress() as watch:
        for step in range(100):
            clock[0] += 0.99 * LINE_S / 100
            watch("reading", step / 100)
    assert capsys.readouterr().err == ""


def test_what_is_not_says_how_much_is_done(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    with share_progress() as watch:
        watch("reading", 0.0)
        clock[0] += LINE_S
        watch("reading", 0.25)
        watch("reading", 0.26)
    assert capsys.readouterr().err == "reading: 25 %\n"


class Gone(StringIO):
    """A pipe whose reader is gone, after ``room`` lines."""

    def __init__(self, room: int) -> None:
        super().__init__()
        self._room = room
        self.tried = 0

    def write(self, text: str, /) -> int:
        self.tried += 1
        if self.tried > self._room:
            raise BrokenPipeError
        return super().write(text)


@pytest.mark.parametrize("room", [0, 2])
def test_who_reads_no_more_ends_nothing(
    room: int, clock: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    pipe = Gone(room)
    monkeypatch.setattr(sys, "stderr", pipe)
    with progress(60.0) as watch:
        for second in range(0, 200, 10):
            clock[0] = 1000.0 + second
            watch(Stage.CLOCK, 0.1 * second)
    assert pipe.tried == room + 1
    assert pipe.getvalue().count("\n") == room


def test_names_are_said_as_they_are(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    with share_progress() as watch:
        clock[0] += LINE_S
        watch("a[b].tlog", 0.5)
    assert capsys.readouterr().err == "a[b].tlog: 50 %\n"


def test_no_other_test_sees_a_line_however_slow_the_machine_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An hour goes by between any two looks at the clock."""
    monkeypatch.setattr(progress_lines.time, "monotonic", count(0.0, 3600.0).__next__)
    with share_progress() as watch:
        for step in range(10):
            watch("reading", step / 10)
    assert capsys.readouterr().err == ""
