"""Where nobody sees a bar a line is said now and then, and none for what is quick."""

from __future__ import annotations

import pytest

from outrider import progress_lines
from outrider.conductor import Stage
from outrider.console import progress
from outrider.progress_lines import LINE_S
from outrider.share_progress import share_progress


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What it shows, s."""
    shown = [1000.0]
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
