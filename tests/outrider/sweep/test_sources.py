"""A sweep knows by which code it was flown."""

from __future__ import annotations

from pathlib import Path

import pytest

from outrider.errors import InputError
from outrider.sweep import command
from outrider.sweep.sources import digest, sources
from tests.outrider.sweep import runs as sweep_runs


def test_every_package_and_the_recorded_targets_count() -> None:
    found = sources()
    assert {name.split("/")[0] for name in found} == {
        "companion",
        "mavlink_bridge",
        "outrider",
        "sitl",
        "logs",
    }
    assert {
        "companion/avoidance/field/dqmpc.py",
        "outrider/sweep/sources.py",
        "logs/escort-target.tlog",
    } <= found.keys()


def test_a_byte_or_a_name_makes_another_digest(tmp_path: Path) -> None:
    one, other = tmp_path / "one.py", tmp_path / "other.py"
    one.write_text("a = 1\n")
    other.write_text("b = 1\n")
    before = digest({"x": one, "y": other})
    assert digest({"y": other, "x": one}) == before
    assert digest({"x": one, "z": other}) != before
    assert digest({"x": other, "y": one}) != before
    other.write_text("b = 2\n")
    assert digest({"x": one, "y": other}) != before


def test_a_sweep_does_not_go_on_over_changed_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(sweep_runs.FOLDER, str(tmp_path))
    Path("swap.yaml").write_text("name: swap\nscenarios: [antipodal-8]\nruns: 1\n", encoding="utf-8")
    code = tmp_path / "code.py"
    code.write_text("a = 1\n")
    monkeypatch.setattr("outrider.sweep.sources.sources", lambda: {"code": code})
    command.sweep("swap.yaml", jobs=1, out=Path("out"), run="tests.outrider.sweep.runs:swap")
    written = Path("out/journal.jsonl").read_bytes()
    code.write_text("a = 2\n")
    with pytest.raises(InputError, match=r"was flown with code \w+ \(now \w+\)"):
        command.sweep("swap.yaml", jobs=1, out=Path("out"), run="tests.outrider.sweep.runs:swap")
    assert Path("out/journal.jsonl").read_bytes() == written
