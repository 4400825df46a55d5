"""A flight of ``certified-fuzz`` that once did not converge, for a cause that needs a whole scene."""

from __future__ import annotations

import pytest

from outrider.resources import config_root
from outrider.simulation.preparation import measure, prepared
from outrider.sweep.cells import scenario_of
from outrider.sweep.scenes import Scene
from outrider.sweep.tasks import Task
from outrider.yaml_files.yaml_file import load

SCENE = config_root() / "scenes" / "certified-fuzz.yaml"
SEED = 60916


@pytest.mark.slow
def test_a_vehicle_in_a_gap_that_is_too_narrow_asks_for_room() -> None:
    """It rests beside a post, a departed vehicle and one at its goal; a way seems to lead between these.

    Near the places where it begins a way may be nearer to others than plans, so no plan passes the gap.
    """
    task = Task("certified-fuzz", SEED, load(SCENE, Scene).model_dump_json(), is_scene=True)
    summary = measure(prepared(scenario_of(task), str(SCENE)), SEED)
    assert summary["others_converge_s"] is not None
    assert summary["d_min_violations"] == 0
