"""Bodies of the 3-D scene for Foxglove: boxes lie where the obstacles stand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from outrider.export.scene import Stage, bodies
from outrider.runs.source import read
from outrider.runs.surfaces import Surfaces
from tests.outrider.report.runs import leave
from tests.outrider.shipped import scenario

OBSTACLES: list[dict[str, Any]] = [
    {"kind": "box", "at": [4.0, -1.0, 2.0], "size": [2.0, 1.0, 3.0], "yaw_deg": 35.0},
    {"kind": "sphere", "at": [0.0, -4.0, 3.0], "radius": 0.5},
    {"kind": "wall", "ends": [[-3.0, -4.0], [1.0, 3.0]], "thickness": 0.5, "height": 4.0},
]


def sides(cube: dict[str, Any]) -> np.ndarray:
    """The middles (6, 3) of a cube's sides."""
    pose = cube["pose"]
    w, x, y, z = (pose["orientation"][key] for key in "wxyz")
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    half = [0.5 * cube["size"][key] for key in "xyz"]
    offsets = np.vstack([np.diag(half), -np.diag(half)])
    return offsets @ turn.T + [pose["position"][key] for key in "xyz"]


def test_cubes_are_the_boxes_and_their_shells(tmp_path: Path) -> None:
    of = scenario("antipodal-8", vehicles=3, obstacles=OBSTACLES)
    run = read(leave(tmp_path / "run", scenario=of).directory, "tlog:{}")
    assert run.motion is not None
    written = {one.topic: json.loads(one.data) for one in bodies(Stage(of, run.motion, {}))}
    entities = written["/scene/obstacles"]["entities"]
    assert [len(one["cubes"]) for one in entities] == [2, 0, 2]
    assert len(entities[1]["spheres"]) == 2
    surfaces = Surfaces(of.obstacles)
    for k in (0, 2):
        assert entities[k]["frame_id"] == "fleet"
        itself, shell = (sides(one)[:, None] for one in entities[k]["cubes"])
        np.testing.assert_allclose(surfaces.distance(itself, np.array([k])), 0.0, atol=2e-4)
        np.testing.assert_allclose(surfaces.distance(shell, np.array([k])), of.d_min_obstacle, atol=2e-4)
        assert entities[k]["cubes"][1]["color"]["a"] < 0.5
