"""``outrider sweep`` as a whole, with runs that take no time: whatever happens on the way, the same table."""

from __future__ import annotations

import json
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from outrider.errors import InputError
from outrider.scenarios.options import Options
from outrider.scenarios.scenario import Scenario
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
runs: 12
grid:
  companion.methods: [[baseline], [tangential]]
"""
Fly = Callable[..., int]


@pytest.fixture
def fly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Fly:
    """Fly `SWEEP` into the folder ``out`` with a run of `sweep_runs`."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(sweep_runs.FOLDER, str(tmp_path))
    (tmp_path / "methods.yaml").write_text(SWEEP, encoding="utf-8")

    def flown(run: str = "swap", out: str | None = "out", jobs: int = 2, **options: Any) -> int:
        place = None if out is None else Path(out)
        return sweep("methods.yaml", jobs=jobs, out=place, run=f"{RUNS}:{run}", **options)

    return flown


def journal(out: str = "out") -> list[dict[str, Any]]:
    lines = (Path(out) / "journal.jsonl").read_text().splitlines()
    return [json.loads(line)["run"] for line in lines[1:]]


def test_the_directory_holds_everything(fly: Fly, capsys: pytest.CaptureFixture[str]) -> None:
    assert fly(as_json=True) == 1
    said = capsys.readouterr()
    summary = json.loads(said.out)
    assert said.out.count("\n") == 1
    written = json.loads(Path("out/summary.json").read_text())
    assert {key: summary[key] for key in written} == written
    assert set(summary) - set(written) == {"sweep_dir", "wall"}
    assert Path("out/sweep.png").read_bytes().startswith(b"\x89PNG")
    assert (summary["runs"], summary["ended"], len(summary["cells"])) == (24, 24, 2)
    assert len(journal()) == 24


def test_the_figures_are_those_of_the_runs(fly: Fly, capsys: pytest.CaptureFixture[str]) -> None:
    fly(as_json=True)
    summary = json.loads(capsys.readouterr().out)
    found = cells(load(Path("methods.yaml"), Sweep), "x")
    for cell, reported in zip(found, summary["cells"], strict=True):
        runs = [sweep_runs.swap(task(cell, seed)) for seed in range(1, 13)]
        assert reported["converged"] == sum(run["converged"] for run in runs)
        assert reported["violations"] == sum(run["d_min_violations"] > 0 for run in runs)
        assert reported["min_separation_m"]["least"] == min(run["min_separation_m"] for run in runs)
        arrived = sorted(run["convergence_time_s"] or 1e9 for run in runs)
        assert reported["convergence_time_s"]["median"]["value"] == pytest.approx(arrived[5])


def test_the_number_of_jobs_changes_nothing(fly: Fly, capsys: pytest.CaptureFixture[str]) -> None:
    fly(jobs=1)
    one, table = Path("out/summary.json").read_bytes(), capsys.readouterr().out
    Path("out").rename("first")
    fly(jobs=3)
    assert Path("out/summary.json").read_bytes() == one
    assert capsys.readouterr().out == table


# Resume


@pytest.mark.slow
def test_a_sweep_that_is_killed_goes_on_and_ends_with_the_same_table_to_the_byte(
    fly: Fly, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fly(out="whole")
    expected = capsys.readouterr().out.replace("whole/", "out/")
    program = (
        "import sys; from pathlib import Path; from outrider.sweep.command import sweep; "
        "sys.exit(sweep('methods.yaml', jobs=2, out=Path('out'), runs=14, "
        f"run='{RUNS}:kills_sweep'))"
    )
    environment = {"PYTHONPATH": ":".join(sys.path), sweep_runs.FOLDER: str(tmp_path)}
    lines = 0
    for _ in range(20):
        done = subprocess.run(
            [sys.executable, "-c", program], env=environment, capture_output=True, text=True
        )
        assert len(journal()) >= lines
        lines = len(journal())
        if done.returncode != -signal.SIGKILL:
            break
    assert done.returncode == 1, done.stderr
    assert len(list(tmp_path.glob("*-4"))) == 2, "the seed was tried in both cells"
    # No run was repeated; and those that were flown beyond the twelve do not count.
    assert len({(run["key"], run["seed"]) for run in journal()}) == len(journal()) == 28
    assert fly() == 1
    assert capsys.readouterr().out == expected
    whole = Path("whole/summary.json").read_text().replace("whole/", "out/")
    assert Path("out/summary.json").read_text() == whole


def test_what_has_ended_is_not_flown_again(fly: Fly, tmp_path: Path) -> None:
    fly("counted", runs=5)
    fly("counted", runs=8)
    fly("counted", runs=8)
    starts = [path.read_text().splitlines() for path in tmp_path.glob("*-[0-9]")]
    assert len(starts) == 16
    assert all(len(start) == 1 for start in starts)


def test_a_run_that_was_lost_is_tried_again_on_resume_and_a_fault_is_not(
    fly: Fly, capsys: pytest.CaptureFixture[str]
) -> None:
    assert fly("kills_always", runs=4, as_json=True) == 3
    said = capsys.readouterr()
    summary = json.loads(said.out)
    assert (summary["lost"], summary["ended"]) == (2, 6)
    for cell in summary["cells"]:
        (lost,) = cell["lost_runs"]
        assert (lost["seed"], lost["why"], lost["what"]) == (3, "lost", "its worker was killed by SIGKILL")
        assert "--seed 3" in lost["command"]
    assert "seed 3: its worker was killed by SIGKILL" in said.err
    # Resumed, by a program that has been mended.
    assert fly("breaks", runs=4, as_json=True) == 3
    summary = json.loads(capsys.readouterr().out)
    assert (summary["lost"], summary["faults"], summary["wall"]["flown_now"]) == (0, 2, 2)
    fly("swap", runs=4, as_json=True)
    again = json.loads(capsys.readouterr().out)
    assert (again["faults"], again["wall"]["flown_now"]) == (2, 0)


def test_a_run_that_succeeds_the_second_time_is_no_loss_but_is_named(
    fly: Fly, capsys: pytest.CaptureFixture[str]
) -> None:
    assert fly("kills_once", runs=5, as_json=True) == 0
    said = capsys.readouterr()
    summary = json.loads(said.out)
    assert (summary["lost"], summary["ended"]) == (0, 10)
    assert [lost["seed"] for lost in summary["wall"]["lost_on_the_way"]] == [3, 3]
    assert sum(run["status"] == "lost" for run in journal()) == 2


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_keeps_what_was_flown_and_says_how_to_go_on(
    fly: Fly, capsys: pytest.CaptureFixture[str]
) -> None:
    assert fly("interrupted", jobs=1) == 3
    said = capsys.readouterr()
    assert said.out == ""
    assert "stopped after 8 of 24 runs" in said.err
    assert "outrider sweep methods.yaml --out out" in said.err
    assert len(journal()) == 8
    assert fly("interrupted", jobs=1) == 3
    assert fly("interrupted", jobs=1) == 0
    assert len(journal()) == 24


# Status, and what is refused


def test_all_well_is_0(fly: Fly) -> None:
    assert fly("fine") == 0


def test_a_run_that_raises_is_3_without_a_traceback(fly: Fly, capsys: pytest.CaptureFixture[str]) -> None:
    assert fly("breaks") == 3
    said = capsys.readouterr()
    assert "Traceback" not in said.out + said.err
    assert "this is no result" not in said.out
    assert "RuntimeError: seed 3 is bad" in said.out


def test_another_sweep_in_the_directory_is_refused(fly: Fly) -> None:
    fly("fine", runs=1)
    Path("methods.yaml").write_text(SWEEP + "set: {vehicles: 4}\n")
    with pytest.raises(InputError, match="is of another sweep"):
        fly("fine", runs=1)


def test_a_directory_of_something_else_is_refused(fly: Fly, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no journal\.jsonl"):
        fly(out=".")
    assert [path.name for path in tmp_path.iterdir()] == ["methods.yaml"]


def test_bad_input_leaves_no_directory(fly: Fly) -> None:
    Path("methods.yaml").write_text(SWEEP + "set: {vehicles: 0}\n")
    with pytest.raises(InputError, match="cell 'methods=baseline'"):
        fly(out=None)
    assert not Path("runs").exists()


def test_without_out_it_has_a_directory_that_is_found_again(fly: Fly) -> None:
    fly("fine", out=None, runs=1)
    fly("fine", out=None, runs=2)
    assert [path.name for path in Path("runs").iterdir()] == ["sweep-methods"]
    assert len(journal("runs/sweep-methods")) == 4


# Replay


@pytest.mark.parametrize("kind", ["scenario", "scene"])
def test_the_command_of_a_run_names_exactly_what_was_flown(
    kind: str, fly: Fly, capsys: pytest.CaptureFixture[str]
) -> None:
    if kind == "scene":
        Path("methods.yaml").write_text("name: methods\nscenes: [clutter]\ngrid: {difficulty: [0.1, 0.9]}\n")
    fly("swap", runs=9, as_json=True)
    summary = json.loads(capsys.readouterr().out)
    spec = load(Path("methods.yaml"), Sweep).model_copy(update={"runs": 9})
    for cell, reported in zip(cells(spec, "x"), summary["cells"], strict=True):
        assert reported["worst"]
        for worst in reported["worst"]:
            program, command, file, *options = shlex.split(worst["command"])
            assert (program, command) == ("outrider", "swarm")
            assert options[:2] == ["--seed", str(worst["seed"])]
            prepared = prepare(file, Options())
            one = task(cell, worst["seed"])
            assert prepared.scenario == scenario_of(one)
            assert prepared.vehicle.model_dump_json() == one.vehicle
            assert isinstance(prepared.scenario, Scenario)


def test_the_worst_come_first_violations_before_all(fly: Fly, capsys: pytest.CaptureFixture[str]) -> None:
    fly("swap", runs=60)
    lines = capsys.readouterr().out.splitlines()
    kinds = [line.split(":")[0] for line in lines if ", seed " in line]
    order = ["violation", "stuck", "nearest", "slowest"]
    assert kinds[0] == "violation"
    assert [order.index(kind) for kind in kinds] == sorted(order.index(kind) for kind in kinds)


@pytest.mark.parametrize("kind", ["scenarios: [antipodal-8]", "scenes: [clutter]"])
@pytest.mark.parametrize("arrival", ["all", "others"])
def test_a_run_is_stuck_by_those_that_its_scenario_waits_for(
    fly: Fly, capsys: pytest.CaptureFixture[str], kind: str, arrival: str
) -> None:
    key = "arrival" if "scenarios" in kind else "scenario.arrival"
    text = f"name: methods\n{kind}\nruns: 2\nset: {{{key}: {arrival}}}\n"
    Path("methods.yaml").write_text(text, encoding="utf-8")
    stuck = 2 if arrival == "all" else 0
    assert fly("only_others", as_json=True) == (1 if stuck else 0)
    (cell,) = json.loads(capsys.readouterr().out)["cells"]
    assert (cell["stuck"], cell["converged"]) == (stuck, 2 - stuck)
