"""``outrider compare``: shipped files can be flown, faults are refused, results are counted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from outrider.compare.cells import cells_of
from outrider.compare.command import compare
from outrider.compare.comparison import Comparison
from outrider.compare.results import faults, result_of
from outrider.compare.table import lines, markdown
from outrider.errors import InputError
from outrider.resources import config_root, find
from outrider.sweep.tasks import Entry, Task
from outrider.yaml_files.yaml_file import load

SHIPPED = sorted(path.stem for path in (config_root() / "comparisons").glob("*.yaml"))
LINKS = {"swarm": {"delay_ms": 50.0, "loss": 0.0}}


def flight(**changes: Any) -> dict[str, Any]:
    """Return the figures of a flight that succeeds."""
    found = dict.fromkeys(("path_m", "acceleration2", "jerk2", "stops", "most_speed"), 1.0)
    found |= dict.fromkeys(("most_acceleration", "most_jerk", "plan_ms_p50", "plan_ms_p99"), 1.0)
    found |= {
        "vehicles": 2,
        "arrived": 2,
        "mean_s": 5.0,
        "last_s": 6.0,
        "separation_m": 0.5,
        "obstacle_m": None,
    }
    found |= {"held_epochs": 0, "solver_failures": 0, "d_min_violations": 0, "left_tube": 0}
    found |= {"processor": "one"}
    return {**found, "failure": None, **changes}


def fly(task: Task) -> dict[str, Any]:
    """Stand in for a flight: the last arrival is the seed."""
    return flight(last_s=float(task.seed))


def entries(*flights: dict[str, Any] | None) -> list[Entry]:
    """Return the entries of flights; None is one that raised an error."""
    return [
        Entry("k", seed, "fault" if one is None else "done", None, one, 1.0)
        for seed, one in enumerate(flights, 1)
    ]


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_comparison_can_be_flown(name: str) -> None:
    path = find("comparisons", name)
    comparison = load(path, Comparison)
    found = cells_of(comparison, path, comparison.rows, None)
    assert len({cell.key for cell in found}) == len(comparison.rows)
    assert comparison.unlike
    assert all(one.source for one in comparison.published)


def test_collisions_late_flights_and_faults_are_no_success() -> None:
    comparison = load(find("comparisons", "rmader"), Comparison)
    row = comparison.rows[1]
    late = flight(arrived=1, mean_s=None, last_s=None)
    found = result_of(
        comparison, row, LINKS, ("point", "point"), entries(flight(), flight(separation_m=0.2), late, None)
    )
    assert (found.seeds, found.succeeded, found.collided, found.not_arrived, found.failed) == (4, 1, 1, 1, 1)
    assert (found.mean_s, found.worst_s, found.separation_m) == (5.0, 6.0, 0.2)
    assert found.reaches_bar is False
    assert found.success == 0.25
    fine = result_of(comparison, row, LINKS, ("point", "point"), entries(flight(), flight()))
    assert fine.reaches_bar is True
    slow = result_of(comparison, row, LINKS, ("point", "point"), entries(flight(mean_s=60.0)))
    assert slow.reaches_bar is False
    *published, ours = lines(comparison, fine)
    assert [words[0] for words in published] == [row.label] * len(published)
    assert ours[2:4] == ("50 ms, 0 %", "2 of 2")
    assert ours[-1] == "mean 6.8, all 6.8, success 100 %: reached"
    text = markdown(comparison, [fine])
    assert all(one in text for one in comparison.differences)
    assert all(one.source in text for one in comparison.published)
    assert "plans on an i7" in text
    assert "plans of this table on one" in text


def test_a_violation_of_the_own_distance_misses_every_bar() -> None:
    """Also where the authors count no collision."""
    comparison = load(find("comparisons", "hdsm-circle"), Comparison)
    (row,) = comparison.rows
    for violations, reached in ((0, True), (1, False)):
        apart = {"separation_m": 0.7}
        flights = entries(flight(**apart), flight(d_min_violations=violations, **apart))
        found = result_of(comparison, row, LINKS, ("point", "point"), flights)
        assert (found.succeeded, found.violations, found.reaches_bar) == (2, violations, reached)
        assert bool(faults(flights[1], comparison.measure)) is not reached


def test_published_times_to_the_last_arrival_stand_beside_ours() -> None:
    """RMADER's repository has times of whole flights, so they are no means over vehicles."""
    comparison = load(find("comparisons", "rmader"), Comparison)
    of_repository = [one for one in comparison.published if "mit-acl/rmader" in one.source]
    assert of_repository
    assert all(one.mean_s is None and one.last_s is not None for one in of_repository)


def test_who_touches_an_obstacle_collided_and_the_last_arrivals_have_a_bar() -> None:
    comparison = load(find("comparisons", "lsc-forest"), Comparison)
    row = comparison.rows[0]
    flights = entries(flight(obstacle_m=0.16, last_s=15.0), flight(obstacle_m=0.14, last_s=17.0))
    found = result_of(comparison, row, LINKS, ("point", "point"), flights)
    assert (found.succeeded, found.collided, found.obstacle_m, found.last_s) == (1, 1, 0.14, 16.0)
    fine = [flight(obstacle_m=0.16, last_s=last) for last in (16.0, 17.9, 18.2)]
    reached = [
        result_of(comparison, row, LINKS, ("point", "point"), entries(*some)).reaches_bar
        for some in (fine[:2], fine[1:])
    ]
    assert reached == [True, False]


def test_rows_are_chosen_by_the_beginning_of_their_labels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = f"{__name__}:fly"
    status = compare("rmader", 2, 1, tmp_path / "out", as_json=True, rows=("delay 50", "loss"), run=run)
    document = json.loads(capsys.readouterr().out)
    assert status == 0
    assert [row["row"] for row in document["rows"]] == ["delay 50 ms", "loss 20 %", "loss 50 %"]
    assert {row["worst_s"] for row in document["rows"]} == {2.0}
    assert {row["motion"] for row in document["rows"]} == {"point"}
    assert {one["row"] for one in document["published"]} == {"delay 50 ms"}
    assert (tmp_path / "out" / "compare.md").is_file()


def test_some_rows_of_a_comparison_that_was_flown_whole_are_in_its_folder_already(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is refused, nothing is flown twice, and the table keeps all rows."""

    def labels(*rows: str) -> list[str]:
        assert compare("rmader", 1, 1, tmp_path, as_json=True, rows=rows, run=f"{__name__}:fly") == 0
        return [row["row"] for row in json.loads(capsys.readouterr().out)["rows"]]

    every = labels()
    journal = (tmp_path / "journal.jsonl").read_text()
    assert len(journal.splitlines()) == 1 + len(every) > 2
    assert labels("loss 50") == every
    assert (tmp_path / "journal.jsonl").read_text() == journal


def test_faults_are_refused_before_anything_flies(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such row; rows are delay 0 ms"):
        compare("rmader", rows=("speed",), out=tmp_path / "out")
    with pytest.raises(InputError, match="has one mission"):
        compare("rmader", missions=tmp_path, out=tmp_path / "out")
    with pytest.raises(InputError, match="has no world"):
        compare("rmader", worlds=tmp_path, out=tmp_path / "out")
    with pytest.raises(InputError, match=r"there is no file \*\.csv"):
        compare("maze-dense", worlds=tmp_path, out=tmp_path / "out")
    with pytest.raises(InputError, match="did you mean 'rmader'"):
        compare("rmade", out=tmp_path / "out")
    with pytest.raises(InputError, match="--jobs does not go with --scheduler"):
        compare("rmader", jobs=1, scheduler="tcp://127.0.0.1:1", out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_goal_in_an_obstacle_of_a_world_file_is_refused_before_anything_flies(tmp_path: Path) -> None:
    """Each file that the seeds fly is checked, not only the first, and named."""
    worlds = tmp_path / "worlds"
    worlds.mkdir()
    (worlds / "maze1.csv").write_text("2,2,1,1,1,2\n", encoding="utf-8")
    # Vehicle 12 has its goal at (7, 2, 1).
    (worlds / "maze2.csv").write_text("7,2,1,0.2,0.2,2\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"seed 2, maze2\.csv: vehicle \d+ .* inside obstacles\[0\], a box"):
        compare("maze-sparse", 2, worlds=worlds, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
    run = f"{__name__}:fly"
    assert compare("maze-sparse", 1, 1, tmp_path / "out", as_json=True, worlds=worlds, run=run) == 0


def test_starts_of_a_mission_file_that_overlap_are_refused_before_anything_flies(tmp_path: Path) -> None:
    """In the measure of the scene, in which 0.5 m of height are as much as 0.25 m across."""
    missions = tmp_path / "missions"
    missions.mkdir()
    for number, height in ((1, 1.6), (2, 1.5)):
        ends = [[0.1 * k, 0.5 * k, 0.5] for k in range(-4, 4)] + [[1, 1, 1.0], [1, 1, height]]
        agents = [{"start": end, "goal": [-end[0], -end[1], end[2]]} for end in ends]
        path = missions / f"multi_{number}.json"
        path.write_text(json.dumps({"agents": agents}, indent=1), encoding="utf-8")
    what = r"multi_2\.json:\d+:\d+: agents\.9\.start is 0\.25 m from agents\.8\.start"
    with pytest.raises(InputError, match=what):
        compare("lsc-empty", 2, rows=("10 ",), missions=missions, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
