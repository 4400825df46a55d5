"""What a sweep leaves beside its table: a page, Parquet, and its failures as scenarios."""

from __future__ import annotations

import json
import math
import re
import shlex
from pathlib import Path

import pyarrow.parquet
import pytest

from outrider.errors import InputError
from outrider.scenarios.options import Options
from outrider.simulation.preparation import prepare
from outrider.sweep.cells import cells, scenario_of, task
from outrider.sweep.command import sweep
from outrider.sweep.grid import Sweep
from outrider.yaml_files.yaml_file import load
from tests.outrider.sweep import runs as sweep_runs
from tests.outrider.sweep.runs import RUNS

SWEEP = """
name: methods
scenarios: [antipodal-8]
runs: 30
grid:
  companion.methods: [[baseline], [tangential]]
"""


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("methods.yaml").write_text(SWEEP, encoding="utf-8")


def fly(run: str = "swap", regressions: str | None = None) -> int:
    folder = None if regressions is None else Path(regressions)
    return sweep("methods.yaml", jobs=2, out=Path("out"), run=f"{RUNS}:{run}", failures=folder)


def test_parquet_holds_every_run_and_the_summary(capsys: pytest.CaptureFixture[str]) -> None:
    fly()
    found = cells(load(Path("methods.yaml"), Sweep), "x")
    rows = pyarrow.parquet.read_table("out/runs.parquet").to_pylist()
    assert [(row["key"], row["seed"]) for row in rows] == [(c.key, s) for c in found for s in range(1, 31)]
    for row in rows:
        flown = sweep_runs.swap(task(next(c for c in found if c.key == row["key"]), row["seed"]))
        for name in ("converged", "convergence_time_s", "min_separation_m", "d_min_violations"):
            assert row[name] == flown[name]
    summary = json.loads(Path("out/summary.json").read_text())["cells"]
    for row, cell in zip(pyarrow.parquet.read_table("out/summary.parquet").to_pylist(), summary, strict=True):
        assert (row["cell"], row["runs"], row["violations"]) == (cell["cell"], 30, cell["violations"])
        assert row["min_separation_least_m"] == cell["min_separation_m"]["least"]
        assert row["violation_rate_high"] == pytest.approx(cell["violation_rate"]["high"], abs=1e-6)


def test_the_page_stands_alone_and_says_what_the_table_says() -> None:
    Path("methods.yaml").write_text(SWEEP.replace("runs: 30", "runs: 3"), encoding="utf-8")
    fly("breaks_badly")
    page = Path("out/summary.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in page
    assert "<script" not in page
    assert not re.search(r"""(src|href)=["'](?!data:)""", page)
    assert "RuntimeError: &lt;script&gt; 3 is bad" in page
    assert "methods=baseline" in page
    assert '<h1 class="bad">6 runs, 2 at fault</h1>' in page


@pytest.mark.slow
def test_every_failure_becomes_a_scenario_that_flies_what_failed() -> None:
    assert fly() == 1
    assert fly(regressions="kept/here") == 1
    found = cells(load(Path("methods.yaml"), Sweep), "x")
    failed = {}
    for cell in found:
        for seed in range(1, 31):
            run = sweep_runs.swap(task(cell, seed))
            if run["d_min_violations"] or not run["converged"]:
                failed[f"methods-{cell.slug}-{cell.key[:8]}-seed{seed}.yaml"] = task(cell, seed)
    assert failed
    assert {path.name for path in Path("kept/here").iterdir()} == failed.keys()
    for name, one in failed.items():
        path = Path("kept/here") / name
        assert prepare(str(path), Options()).scenario == scenario_of(one)
        why, command = path.read_text(encoding="utf-8").splitlines()[:2]
        assert f"seed {one.seed}: " in why
        assert shlex.split(command[2:]) == ["outrider", "swarm", name, "--seed", str(one.seed)]
    # Again is the same.
    before = {path: path.read_bytes() for path in Path("kept/here").iterdir()}
    fly(regressions="kept/here")
    assert {path: path.read_bytes() for path in Path("kept/here").iterdir()} == before


def test_what_is_there_stays_and_another_cell_has_other_files() -> None:
    fly(regressions="kept")
    names = {path.name for path in Path("kept").iterdir()}
    mine = sorted(Path("kept").iterdir())[0]
    mine.write_text("name: mine\n")
    fly(regressions="kept")
    assert mine.read_text() == "name: mine\n"
    Path("methods.yaml").write_text(SWEEP.replace("baseline", "swivel"), encoding="utf-8")
    Path("out").rename("before")
    fly(regressions="kept")
    assert names < {path.name for path in Path("kept").iterdir()}
    assert mine.read_text() == "name: mine\n"


def test_where_failures_cannot_be_kept_nothing_is_flown() -> None:
    Path("taken").touch()
    with pytest.raises(InputError, match="--regressions taken: cannot be made"):
        fly(regressions="taken")
    assert not Path("out").exists()


def test_in_parquet_what_never_came_about_is_nothing() -> None:
    Path("methods.yaml").write_text(SWEEP.replace("runs: 30", "runs: 6"), encoding="utf-8")
    fly("stuck_or_broken")
    cells_, runs = (pyarrow.parquet.read_table(f"out/{name}.parquet") for name in ("summary", "runs"))
    for table in (cells_, runs):
        for name in table.column_names:
            values = [value for value in table[name].to_pylist() if isinstance(value, float)]
            assert all(map(math.isfinite, values)), name
    assert cells_["convergence_time_median_s"].to_pylist() == [None, None]
    by_seed = {row["seed"]: row for row in runs.to_pylist()}
    assert by_seed[3]["ending"] == "fault"
    assert by_seed[3]["d_min_violations"] is None
    assert by_seed[1]["d_min_violations"] == 0


def test_all_well_leaves_no_failures() -> None:
    assert fly("fine", regressions="kept") == 0
    assert list(Path("kept").iterdir()) == []
