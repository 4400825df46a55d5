"""``--physics``: the same scenes with a vehicle that moves by its rotors, on its own limits and distances."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from outrider.compare.cells import cells_of
from outrider.compare.command import compare
from outrider.compare.comparison import Comparison, Physics, Row
from outrider.compare.flying import fly
from outrider.compare.physics import in_physics
from outrider.compare.scene import Scene, document_of, scenario_of
from outrider.compare.world import Forest
from outrider.compare.worlds import drawn
from outrider.errors import InputError
from outrider.resources import find
from outrider.scenarios.starts import places
from outrider.sweep.cells import task
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm
from tests.outrider.compare.test_compare import flight

SPAN = load(find("vehicles", "firefly"), VehicleConfig).span


def loaded(name: str) -> tuple[Comparison, Path]:
    path = find("comparisons", name)
    return load(path, Comparison), path


def touching(_: Any) -> dict[str, Any]:
    """Stand in for a flight in which two vehicles keep the points' distance, but not the vehicle's."""
    return flight(separation_m=SPAN - 0.01)


@pytest.mark.parametrize("name", ["rmader", "maze-sparse", "hdsm-circle"])
def test_the_vehicle_has_rotors_and_keeps_its_own_distances(name: str) -> None:
    comparison, path = loaded(name)
    found = in_physics(comparison, path)
    (cell,) = cells_of(found, path, found.rows[:1], None)
    scene = Scene.model_validate_json(cell.document)
    scenario, vehicle = scenario_of(scene, 1), VehicleConfig.model_validate_json(cell.vehicle)
    assert vehicle.motion == "multirotor"
    assert scene.measure.least == scenario.d_min == scenario.companion.field.d_min == SPAN
    assert scene.measure.obstacle in (None, SPAN / 2.0)
    assert scenario.d_min_obstacle == scenario.companion.certified.d_min_obstacle == SPAN / 2.0
    assert scenario.companion.limits.a_total <= 6.9
    assert all(row.bar is None for row in found.rows)
    assert found.name == f"{name}-physics"


@pytest.mark.parametrize(("name", "label"), [("lsc-empty", "20 vehicles"), ("range", "60 vehicles")])
def test_a_row_with_more_vehicles_than_the_scenario_has_starts_for_them(name: str, label: str) -> None:
    comparison, path = loaded(name)
    found = in_physics(comparison, path)
    rows = [row for row in found.rows if row.label == label]
    (cell,) = cells_of(found, path, rows, None)
    scenario = scenario_of(Scene.model_validate_json(cell.document), 1)
    assert f"{scenario.vehicles} vehicles" == label
    assert len(places(scenario)[0]) == scenario.vehicles


def test_the_world_is_that_of_the_points_where_the_vehicle_has_a_way() -> None:
    """A seed draws the same worlds one after another: one that is passable for both is the same."""
    comparison, path = loaded("hdsm-circle")
    wide = in_physics(comparison, path)
    scenarios = []
    for one in (comparison, wide):
        (cell,) = cells_of(one, path, one.rows, None)
        scenarios.append(scenario_of(Scene.model_validate_json(cell.document), 1))
    points, physics = scenarios
    starts, goals = places(physics)
    assert comparison.world is not None
    assert wide.world is not None
    assert goals is not None
    assert wide.world.passable > comparison.world.passable
    again = drawn(wide.world, starts, goals, points.companion.limits, 1)
    assert list(physics.obstacles) == again
    assert len(physics.obstacles) == len(points.obstacles) == 90


def test_a_scene_that_is_too_narrow_is_refused_with_the_reason(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"lanes of the maze are 0\.5 m wide, too narrow for firefly"):
        compare("maze-dense", physics=True, out=tmp_path / "out")
    comparison, path = loaded("rmader")
    with pytest.raises(InputError, match="rmader has no part physics"):
        in_physics(comparison.model_copy(update={"physics": None}), path)
    point = comparison.model_copy(update={"physics": Physics(vehicle="point")})
    with pytest.raises(InputError, match="point is a point; allowed: a vehicle with rotors"):
        in_physics(point, path)
    assert not (tmp_path / "out").exists()


def test_a_row_is_checked_only_if_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    comparison, path = loaded("maze-sparse")
    found = in_physics(comparison, path)
    near = {"starts.at": [[-1, 2, 1], [-1, 2.5, 1]], "starts.goals": [[7, 2, 1], [7, 4, 1]], "vehicles": 2}
    rows = (*found.rows, Row(label="near", set=near))
    checked: list[Scene] = []
    monkeypatch.setattr(
        "outrider.compare.cells.document_of",
        lambda scene, seed: checked.append(scene) or document_of(scene, seed),
    )
    keys = {cell.label: cell.key for cell in cells_of(found, path, rows, None, needed=())}
    assert not checked
    assert keys.keys() == {row.label for row in rows}
    first = cells_of(found, path, rows, None, needed=(rows[0].label,))
    assert {cell.label: cell.key for cell in first} == keys
    assert len(checked) == 1
    with pytest.raises(InputError, match=r"0\.50 m from each other; allowed: at least the 0\.63 m"):
        cells_of(found, path, rows, None, needed=("near",))


def test_the_table_marks_it_and_counts_by_the_vehicles_distance(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where, rows = f"{__name__}:touching", ("delay 50",)
    assert compare("rmader", 1, 1, tmp_path, as_json=True, rows=rows, run=where, physics=True) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["comparison"] == "rmader-physics"
    (row,) = document["rows"]
    assert (row["motion"], row["collided"], row["reaches_bar"]) == ("multirotor", 1, None)
    text = (tmp_path / "compare.md").read_text(encoding="utf-8")
    assert "outrider (firefly, full physics)" in text
    assert "0.63 m from tip to tip" in text


@pytest.mark.parametrize(
    ("name", "kept", "dropped", "new"),
    [
        ("rmader", ["0.25 s one after another", "a plane 2 m above"], ["points whose"], ["v 5 m/s"]),
        (
            "maze-sparse",
            ["they are not their mazes"],
            ["Ours are points", "no such"],
            ["1 m apart", "way.lanes"],
        ),
        ("hdsm-circle", ["know all cylinders at first"], ["points whose", "20 of 40"], ["v 5 m/s"]),
    ],
)
def test_what_is_not_alike_stays_but_what_is_of_points(
    name: str, kept: list[str], dropped: list[str], new: list[str]
) -> None:
    comparison, path = loaded(name)
    before, after = ("\n".join(one.unlike) for one in (comparison, in_physics(comparison, path)))
    assert set(comparison.differences) <= set(in_physics(comparison, path).unlike)
    assert all(text in before and text in after for text in kept)
    assert all(text in before and text not in after for text in dropped)
    assert all(text in after and text not in before for text in ("In full physics", *new))


@pytest.mark.parametrize("name", ["lsc-forest", "lsc-empty"])
def test_a_row_keeps_distances_by_its_own_values(name: str) -> None:
    comparison, path = loaded(name)
    usual, wide = comparison.rows[0], {"companion.certified.tube": 0.3, "companion.certified.drift": 0.3}
    other = usual.model_copy(update={"label": "wide", "set": {**usual.set, **wide}})
    rows = in_physics(comparison.model_copy(update={"rows": (usual, other)}), path).rows
    if comparison.missions is not None:
        assert rows[0].missions is not None
        assert rows[1].missions is not None
        assert rows[1].missions.apart == pytest.approx(rows[0].missions.apart + 0.4)
    else:
        assert isinstance(rows[0].world, Forest)
        assert isinstance(rows[1].world, Forest)
        assert rows[1].world.passable == pytest.approx(rows[0].world.passable + 0.2)


def test_what_the_vehicle_decides_is_not_for_rows_and_world_files_are_not_checked(tmp_path: Path) -> None:
    comparison, path = loaded("rmader")
    row = Row(label="near", set={"d_min": 0.3})
    with pytest.raises(InputError, match="the row 'near' sets d_min, which the vehicle decides"):
        in_physics(comparison.model_copy(update={"rows": (row,), "published": ()}), path)
    with pytest.raises(InputError, match="--physics does not go with --worlds"):
        compare("maze-sparse", physics=True, worlds=tmp_path, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_vehicles_in_full_physics_change_sides_through_a_maze() -> None:
    comparison, path = loaded("maze-sparse")
    found = in_physics(comparison, path)
    ends = {"at": [[-1, 3.75, 1], [-1, 1.75, 1], [7, 2.75, 1]]}
    ends["goals"] = [[7, 2.75, 1], [7, 1.75, 1], [-1, 2.75, 1]]
    few = Row(label="few", set={"vehicles": 3})
    three = found.model_copy(update={"set": {**found.set, **{f"starts.{k}": at for k, at in ends.items()}}})
    (cell,) = cells_of(three, path, (few,), None)
    flown = fly(task(cell, 2))
    assert flown["arrived"] == flown["vehicles"] == 3
    assert flown["separation_m"] >= SPAN
    assert flown["obstacle_m"] >= SPAN / 2.0
    assert flown["d_min_violations"] == flown["solver_failures"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 3])
def test_ten_whose_goals_lie_beside_the_lattice_s_places_change_sides_through_a_maze(seed: int) -> None:
    """The companions' certified mode with points in place of autopilots and vehicles.

    In these mazes vehicles that were pushed aside did not see their next places, those at their goals kept
    others from the places beside these, and six waited for each other in a circle.
    """
    comparison, path = loaded("maze-sparse")
    (cell,) = cells_of(in_physics(comparison, path), path, comparison.rows, None)
    scenario = scenario_of(Scene.model_validate_json(cell.document), seed)
    starts, goals = places(scenario)
    assert goals is not None
    companion = scenario.companion.model_dump()
    own = ("limits", "field", "way")
    swarm = Swarm(
        starts,
        Rough(delay=20_000),
        [Habits()] * len(starts),
        1,
        planar=True,
        settings={
            key: value
            for key, value in companion["certified"].items()
            if key not in ("fleet", "dt_us", "epoch_us", "plane_shift")
        },
        more={
            **{key: companion[key] for key in own},
            "obstacles": [one.model_dump() for one in scenario.obstacles],
        },
    )
    until = 40_000_000
    swarm.run(until, lambda _since, system: goals[system - 1])
    ends = np.array([one.plan(EPOCH + until).positions_m()[0] for one in swarm.vehicles])
    assert np.linalg.norm(ends - goals, axis=1).max() < 0.1
    assert swarm.faults() == []
