"""Each flight of a comparison that fails is named with its fault, and its scenario can be flown again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from outrider.compare.cells import cells_of
from outrider.compare.command import compare
from outrider.compare.comparison import Comparison
from outrider.compare.failed_flights import FailedFlight, write
from outrider.compare.scene import Scene, scenario_of
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.sweep.cells import Cell
from outrider.sweep.tasks import Task
from outrider.yaml_files.yaml_file import load
from tests.outrider.compare.test_compare import flight

RUN = f"{__name__}:fly"
FAULTS = {
    2: ({"obstacle_m": 0.1}, "a vehicle and an obstacle were 0.1 m apart; less than 0.15 m is a collision"),
    3: ({"arrived": 1, "mean_s": None, "last_s": None}, "1 of 2 arrived"),
    4: ({"d_min_violations": 3}, "3 violations of d_min"),
}


def fly(task: Task) -> dict[str, Any]:
    """Stand in for flights, of which some fail, and one raises an error."""
    if task.seed == 5:
        raise ArithmeticError("in two\nlines")
    return flight(**FAULTS[task.seed][0]) if task.seed in FAULTS else flight()


def test_failed_flights_leave_their_scenarios(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert compare("maze-sparse", 6, 1, tmp_path, as_json=True, run=RUN) == 1
    said = capsys.readouterr().err
    files = sorted((tmp_path / "failed").iterdir())
    assert [file.name.rpartition("-seed")[2] for file in files] == ["2.yaml", "3.yaml", "4.yaml", "5.yaml"]
    path = find("comparisons", "maze-sparse")
    comparison = load(path, Comparison)
    (cell,) = cells_of(comparison, path, comparison.rows, None)
    for seed, file in enumerate(files, 2):
        what = FAULTS[seed][1] if seed in FAULTS else "in two lines"
        comment = file.read_text(encoding="utf-8").splitlines()[0]
        assert what in comment
        assert f"seed {seed}: " in said
        assert what in said
        assert load(file, Scenario) == scenario_of(Scene.model_validate_json(cell.document), seed)


def test_flights_without_a_fault_leave_no_files(tmp_path: Path) -> None:
    """And those of an earlier command, with more seeds, are not left beside its table."""
    assert compare("maze-sparse", 1, 1, tmp_path, as_json=True, run=RUN) == 0
    assert not (tmp_path / "failed").exists()
    assert compare("maze-sparse", 3, 1, tmp_path, as_json=True, run=RUN) == 1
    assert len(list((tmp_path / "failed").iterdir())) == 2
    assert compare("maze-sparse", 1, 1, tmp_path, as_json=True, run=RUN) == 0
    assert not list((tmp_path / "failed").iterdir())


def test_a_flight_that_cannot_be_drawn_is_named_without_a_file(tmp_path: Path) -> None:
    cell = Cell("a row", "001-x", "k", '{"scenario": {}}', "{}", is_scene=False)
    assert write(tmp_path, [FailedFlight(cell, 2, ["no world"])]) == []


def test_unprintable_characters_of_an_error_leave_a_file_that_loads(tmp_path: Path) -> None:
    path = find("comparisons", "maze-sparse")
    comparison = load(path, Comparison)
    (cell,) = cells_of(comparison, path, comparison.rows, None)
    (file,) = write(tmp_path, [FailedFlight(cell, 2, ["red \x1b[31m\x00 text"])])
    load(file, Scenario)
