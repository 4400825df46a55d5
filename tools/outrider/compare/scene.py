"""What a worker flies: a row of a comparison with the starts and goals of a seed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from outrider.compare import worlds
from outrider.compare.comparison import Measure, Missions
from outrider.compare.missions import Mission, drawn
from outrider.compare.world import World
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.starts import places

Places = tuple[tuple[float, float, float], ...]


class Scene(BaseModel):
    """What a worker flies.

    ``scenario``: values of the scenario file. Its starts are those of ``given`` (one mission for each seed:
    starts and goals), or drawn by ``missions`` for ``vehicles``, or its own. Obstacles are added to its own:
    those of ``worlds`` (values of one world for each seed), or drawn by ``world``.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    scenario: dict[str, Any]
    measure: Measure
    goal_radius: float
    vehicles: int
    missions: Missions | None = None
    given: tuple[tuple[Places, Places], ...] = ()
    world: World | None = None
    worlds: tuple[tuple[dict[str, Any], ...], ...] = ()


def scenario_of(scene: Scene, seed: int) -> Scenario:
    """Return the scenario that a scene flies with ``seed``.

    Raises InputError if no mission or no world can be drawn.
    """
    return Scenario.model_validate_json(json.dumps(document_of(scene, seed)), strict=True)


def document_of(scene: Scene, seed: int) -> dict[str, Any]:
    """Return the values of the scenario that a scene flies with ``seed``; raises as ``scenario_of``."""
    document = _with_mission(scene, seed)
    if scene.worlds:
        more: Sequence[Any] = scene.worlds[(seed - 1) % len(scene.worlds)]
    elif scene.world is not None:
        scenario = Scenario.model_validate_json(json.dumps(document), strict=True)
        starts, goals = places(scenario)
        ends = starts if goals is None else goals
        found = worlds.drawn(scene.world, starts, ends, scenario.companion.limits, seed)
        more = [one.model_dump(mode="json") for one in found]
    else:
        return document
    return {**document, "obstacles": [*document.get("obstacles", ()), *more]}


def _with_mission(scene: Scene, seed: int) -> dict[str, Any]:
    """Return the values of the scenario with the starts and goals of ``seed``."""
    if scene.given:
        starts, goals = scene.given[(seed - 1) % len(scene.given)]
        return _placed(scene.scenario, Mission(np.array(starts), np.array(goals)))
    if scene.missions is not None:
        return _placed(scene.scenario, drawn(scene.missions, scene.measure, scene.vehicles, seed))
    return scene.scenario


def _placed(scenario: dict[str, Any], mission: Mission) -> dict[str, Any]:
    """Return the values of the scenario with the starts and goals of ``mission``."""
    points = {"kind": "points", "at": mission.starts.tolist(), "goals": mission.goals.tolist()}
    return {**scenario, "task": "goto", "starts": points, "vehicles": len(mission.starts)}
