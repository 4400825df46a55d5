"""The command ``outrider`` as a script sees it."""

from __future__ import annotations

import math
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from outrider.__main__ import main
from outrider.terminal import compilation, progress_lines
from tests.outrider.said import Ended, Run


@pytest.fixture(autouse=True)
def _any_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a command writes does not depend on how fast the machine is, on what it has compiled before, or on
    the terminal that the tests were started in: no line of progress, however long something takes, no notice
    of a compilation, and the width of a pipe."""
    monkeypatch.setattr(progress_lines, "LINE_S", math.inf)
    monkeypatch.setattr(compilation, "report_compilation", lambda to: None)
    monkeypatch.setenv("COLUMNS", "80")


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """SIGINT interrupts, as in a terminal. A shell ignores it in what a script starts in the background, and
    the tests may be that."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs ``outrider`` with arguments in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> Ended:
        monkeypatch.setattr(sys, "argv", ["outrider", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        code = ended.value.code
        assert code is None or isinstance(code, int)
        return Ended(code or 0, *capsys.readouterr())

    return call
