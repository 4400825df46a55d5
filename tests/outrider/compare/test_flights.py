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
    assert found["most_acceleration"] <= 2.0
    assert found["jerk2"] is None
    assert 0.0 < found["mean_s"] <= found["last_s"] < 60.0
