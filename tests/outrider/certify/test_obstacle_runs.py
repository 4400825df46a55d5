"""``outrider replay --certify`` on flights among fixed obstacles."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from companion.avoidance.certified.committed import controls
from companion.avoidance.certified.constraint_sources import ConstraintSources
from companion.values.horizon import Array
from outrider.certify.command import certify
from outrider.certify.histories import Kind
from outrider.certify.reading import read, terms_of
from outrider.certify.verdict import Verdict, judge
from outrider.errors import InputError
from outrider.scenarios.options import apply
from outrider.scenarios.world_file import read_world, write_world
from outrider.simulation.preparation import Prepared
from outrider.swarm import command as swarm
from tests.outrider.certify.runs import CERTIFIED
from tests.outrider.certify.test_fly_runs import as_fly
from tests.outrider.shipped import FIREFLY, scenario

NEARER = "a plan nearer to a fixed obstacle than certified"
POSTS = [
    {"kind": "post", "at": [-1.5, 0.3], "radius": 0.3},
    {"kind": "sphere", "at": [1.5, -0.3, 5.0], "radius": 0.3},
]
BOXES = [
    {"kind": "box", "at": [-1.5, 0.3, 3.0], "size": [0.6, 0.6, 6.0], "yaw_deg": 20.0},
    {"kind": "wall", "ends": [[1.5, -0.2], [1.5, -3.0]], "thickness": 0.3, "height": 12.0},
]
FAR = [
    {"kind": "box", "at": [3.0 * k - 200.0, 40.0, 1.0], "size": [1.0, 1.0, 2.0], "yaw_deg": 7.0}
    for k in range(120)
]
"""So many that a run directory has them in a file of their own."""


def fly(directory: Path, obstacles: list[dict[str, object]], *, cap_s: float = 5.0) -> Path:
    """Two vehicles change places, past obstacles."""
    directory.mkdir()
    of = scenario(
        "boxes",
        vehicles=2,
        airborne=True,
        cap_s=cap_s,
        starts={"at": [[-4.0, 0.0, 5.0], [4.0, 0.0, 5.0]], "goals": [[4.0, 0.0, 5.0], [-4.0, 0.0, 5.0]]},
        obstacles=obstacles,
    )
    swarm.fly(Prepared(apply(of, CERTIFIED), FIREFLY), 1, directory, lambda _stage, _seconds: None)
    return directory


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fly(tmp_path_factory.mktemp("flown") / "run", [POSTS[0], BOXES[1], *FAR])


def verdict(directory: Path) -> Verdict:
    return judge(read(directory, lambda _name, _share: None))


def whats(found: Verdict) -> set[str]:
    return {finding.what for finding in found.findings}


def on_the_way(found: Verdict) -> Array:
    """A place (3,), m, that the middle of a plan of 11 passes in flight."""
    steps = [step.plan for step in found.histories[0].steps if step.kind is Kind.MADE]
    plan = steps[len(steps) // 3]
    return np.asarray(controls(plan)[4, 2])


def test_a_flight_among_posts_and_walls_is_certified(flown: Path) -> None:
    found = verdict(flown)
    assert found.findings == ()
    document = found.document()
    assert document["obstacles_checked"] > 10
    assert document["required_to_obstacle_m"] <= document["least_to_obstacle_m"] + 1e-6
    # They have passed the obstacles closely, and those far away were not looked at.
    assert document["least_to_obstacle_m"] < document["required_to_obstacle_m"] + 0.1
    assert document["least_to_obstacle"][1].startswith(("obstacles[0], a post at", "obstacles[1], a wall"))
    assert document["obstacles_checked"] <= 2 * (document["plans"] + document["carried_on"])


def test_an_obstacle_where_a_plan_passes_is_found(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = on_the_way(verdict(run))
    path = run / "configuration.yaml"
    document = yaml.safe_load(path.read_text())
    document["scenario"]["obstacles"][0]["at"] = place[:2].tolist()
    path.write_text(yaml.safe_dump(document))
    assert certify(run, as_json=True) == 1
    findings = json.loads(capsys.readouterr().out)["findings"]
    named = [one for one in findings if one["what"] == NEARER and one["who"] == [11]]
    assert "obstacles[0], a post at" in named[0]["figures"]
    assert 0.0 < named[0]["when_s"] < 6.0
    assert certify(run) == 1
    shown = capsys.readouterr().out
    assert "not certified" in shown
    assert f"{NEARER}: 11, " in shown


def test_a_box_of_the_world_file_of_the_run_is_found(run: Path) -> None:
    place = on_the_way(verdict(run))
    boxes = list(read_world(run / "world.csv"))
    assert len(boxes) == len(FAR)
    x, y, z = place.tolist()
    boxes[77] = boxes[77].model_copy(update={"at": (x, y, z)})
    write_world(run / "world.csv", boxes)
    found = [one for one in verdict(run).findings if one.what == NEARER]
    assert {one.who for one in found} >= {(11,)}
    assert all("obstacles[79], a box at" in one.figures for one in found)


def test_runs_of_fly_are_checked_against_the_obstacles_of_each(flown: Path, tmp_path: Path) -> None:
    known, runs = verdict(flown), as_fly(flown, tmp_path)
    assert verdict(runs).document() == known.document()
    path = runs / "fly-11" / "configuration.yaml"
    document = yaml.safe_load(path.read_text())
    x, y, z = on_the_way(known).tolist()
    document["companion"]["obstacles"][50]["at"] = [x, y, z]
    path.write_text(yaml.safe_dump(document))
    found = verdict(runs)
    assert [(one.what, one.who) for one in found.findings] == [(NEARER, (11,))]
    assert "obstacles[50], a box at" in found.findings[0].figures
    again = Path(shutil.copytree(runs / "fly-12", runs / "fly-12-again"))
    path = again / "configuration.yaml"
    path.write_text(path.read_text().replace("radius: 0.3", "radius: 0.4"))
    with pytest.raises(InputError, match=r"companion.obstacles of vehicle 12 differ.*allowed: the same"):
        read(runs, lambda _name, _share: None)


Break = Callable[[pytest.MonkeyPatch], None]


def without_planes_of_boxes(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(ConstraintSources, "_boxes_near", lambda self, own: None)


def without_posts(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(ConstraintSources, "_fixed_constraints", lambda self, own: [])


def with_a_smaller_margin(patch: pytest.MonkeyPatch) -> None:
    """Boxes at 5 cm less than the distance that is promised."""
    begin = ConstraintSources.__init__

    def nearer(self: ConstraintSources, *arguments: object) -> None:
        begin(self, *arguments)  # type: ignore[arg-type]
        self._from_surfaces -= 0.05

    patch.setattr(ConstraintSources, "__init__", nearer)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("breaks", "obstacles"),
    [(without_planes_of_boxes, BOXES), (without_posts, POSTS), (with_a_smaller_margin, BOXES)],
)
def test_a_planner_without_these_constraints_is_found(
    breaks: Break, obstacles: list[dict[str, object]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert verdict(fly(tmp_path / "clean", obstacles, cap_s=3.0)).findings == ()
    breaks(monkeypatch)
    assert NEARER in whats(verdict(fly(tmp_path / "broken", obstacles, cap_s=3.0)))


def test_plans_are_held_to_the_least_distance_of_obstacles_that_companions_have() -> None:
    of = apply(scenario("boxes"), CERTIFIED)
    certified = of.companion.certified.model_copy(update={"d_min_obstacle": 0.3})
    companion = of.companion.model_copy(update={"certified": certified})
    other = terms_of(of.model_copy(update={"companion": companion}))
    same = terms_of(of)
    assert same.surface - other.surface == pytest.approx(of.companion.field.d_min - 0.3)
    assert other == same._replace(surface=other.surface)
