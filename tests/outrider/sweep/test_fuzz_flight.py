"""Flights of ``certified-fuzz`` that once did not converge, for causes that need a whole scene."""

from __future__ import annotations

from typing import Any

import pytest

from outrider.resources import config_root
from outrider.simulation.preparation import measure, prepared
from outrider.sweep.cells import scenario_of
from outrider.sweep.scenes import Scene
from outrider.sweep.tasks import Task
from outrider.yaml_files.yaml_file import load

SCENE = config_root() / "scenes" / "certified-fuzz.yaml"


def flown(seed: int) -> dict[str, Any]:
    """Summary of the flight of ``seed``."""
    task = Task("certified-fuzz", seed, load(SCENE, Scene).model_dump_json(), is_scene=True)
    return measure(prepared(scenario_of(task), str(SCENE)), seed)


@pytest.mark.slow
def test_a_vehicle_in_a_gap_that_is_too_narrow_asks_for_room() -> None:
    """It rests beside a post, a departed vehicle and one at its goal; a way seems to lead between these.

    Near the places where it begins a way may be nearer to others than plans, so no plan passes the gap.
    """
    summary = flown(60916)
    assert summary["others_converge_s"] is not None
    assert summary["d_min_violations"] == 0


@pytest.mark.slow
def test_a_vehicle_beside_its_covered_goal_leaves_the_goal_of_another_one() -> None:
    """A landed vehicle covers the goal of A. A rests at the nearest free place, too near to the goal of B."""
    summary = flown(60468)
    assert summary["covered_goals"] == 1
    assert summary["others_converge_s"] is not None
    assert summary["d_min_violations"] == 0
