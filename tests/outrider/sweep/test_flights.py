"""Sweeps of real flights: the same whoever flies them, and the command of a run gives its numbers again."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from outrider.__main__ import app
from outrider.runs.summary import WALL_FIELDS
from outrider.sweep.command import sweep

SCENARIO = """
name: pairs
scenarios: [antipodal-8]
runs: 2
set: {airborne: true, vehicles: 2, starts.radius: 3.0, companion.rates.replan_us: 50000, cap_s: 4.0}
grid: {links.swarm.loss: [0.0, 0.3]}
"""
SCENE = """
name: pairs
scenes: [clutter]
runs: 2
set: {vehicles: [2, 3], scenario.cap_s: 3.0}
"""


@pytest.mark.slow
@pytest.mark.parametrize("text", [SCENARIO, SCENE], ids=["scenario", "scene"])
def test_flights_depend_on_cell_and_seed_alone_and_are_replayed_exactly(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("pairs.yaml").write_text(text, encoding="utf-8")
    seen = {}
    for jobs in (1, 2):
        sweep("pairs.yaml", jobs=jobs, out=Path(f"out{jobs}"))
        lines = Path(f"out{jobs}/journal.jsonl").read_text().splitlines()[1:]
        runs = [json.loads(line)["run"] for line in lines]
        seen[jobs] = {(run["key"], run["seed"]): run["summary"] for run in runs}
    assert seen[1] == seen[2]
    assert [run["what"] for run in runs] == [None] * len(runs)
    assert len({json.dumps(summary) for summary in seen[1].values()}) == len(seen[1])
    capsys.readouterr()
    summary = json.loads(Path("out1/summary.json").read_text())
    cell = summary["cells"][-1]
    worst = cell["worst"][0]
    words = shlex.split(worst["command"])[1:]
    said = CliRunner().invoke(app, [*words, "--json"])
    replayed: dict[str, Any] = json.loads(said.stdout)
    expected = seen[1][cell["key"], worst["seed"]]
    assert {key: value for key, value in replayed.items() if key not in WALL_FIELDS} == expected
