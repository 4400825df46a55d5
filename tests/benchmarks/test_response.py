"""The comparison with recorded flights says what is wrong with them; what it finds is in
``test_recorded_flights``."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from benchmarks.response import LOGS, SWARMS, main

TARGET = Path(__file__).parents[2] / "config" / "logs" / "escort-target.tlog"


@pytest.mark.parametrize("there", [False, True])
def test_logs_that_are_not_there_or_something_else(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    if there:
        shutil.copy(TARGET, tmp_path / "copter-full.tlog.gz")
    monkeypatch.setattr(sys, "argv", ["response.py", "--logs", str(tmp_path)])
    assert main() == 2
    said = capsys.readouterr()
    assert "copter-full.tlog.gz" in said.err
    assert not said.out


@pytest.mark.parametrize("there", [False, True])
def test_swarms_that_are_not_there_or_something_else(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    for log in LOGS.glob("*.tlog.gz"):
        shutil.copy(log, tmp_path)
    if there:
        shutil.copy(TARGET, tmp_path / f"{SWARMS[0]}.npz")
    monkeypatch.setattr(sys, "argv", ["response.py", "--logs", str(tmp_path)])
    assert main() == 2
    said = capsys.readouterr()
    assert f"{SWARMS[0]}.npz" in said.err
    assert not said.out
