"""A flight of a shipped scene: its figures are those of the motion, and it keeps the scene's limits."""

from __future__ import annotations

import pytest

from outrider.compare.cells import cells_of
from outrider.compare.comparison import Comparison, Row
from outrider.compare.flying import fly
from outrider.resources import find
from outrider.sweep.cells import task
from outrider.yaml_files.yaml_file import load


@pytest.mark.slow
def test_vehicles_cross_a_box_apart_in_the_ellipsoid() -> None:
    path = find("comparisons", "lsc-empty")
    comparison = load(path, Comparison)
    (cell,) = cells_of(comparison, path, (Row(label="few", set={"vehicles": 5}),), None)
    found = fly(task(cell, 2))
    assert found["arrived"] == found["vehicles"] == 5
    assert found["separation_m"] >= comparison.measure.least
    assert found["d_min_violations"] == found["solver_failures"] == 0
    # Its tubes of 1 mm hold what companions know of the positions of points.
    assert found["left_tube"] == 0
    assert found["most_acceleration"] <= 2.0
    assert found["jerk2"] is None
    assert 0.0 < found["mean_s"] <= found["last_s"] < 60.0


@pytest.mark.slow
def test_vehicles_change_sides_through_a_maze_of_boxes() -> None:
    path = find("comparisons", "maze-sparse")
    comparison = load(path, Comparison)
    starts = {"at": [[-1, 3, 1], [-1, 2, 1], [7, 3, 1]], "goals": [[7, 3, 1], [7, 2, 1], [-1, 3, 1]]}
    few = Row(label="few", set={"vehicles": 3, **{f"starts.{name}": at for name, at in starts.items()}})
    (cell,) = cells_of(comparison, path, (few,), None)
    found = fly(task(cell, 2))
    assert found["arrived"] == found["vehicles"] == 3
    assert found["separation_m"] >= comparison.measure.least
    assert found["obstacle_m"] >= 0.15
    assert found["d_min_violations"] == found["solver_failures"] == 0
    # The maze is 6 m long, and no way through it is straight.
    assert 8.0 < found["path_m"] < 20.0
