"""Scenario drawn from a scene and a seed, the same every time.

Each group of quantities has its own stream of random numbers, so a change of one group leaves the random
numbers of the others as they are. Positions that depend on the changed group may still change.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from pydantic import JsonValue

from outrider.scenarios.streams import Stream, stream
from outrider.sweep.grid import leaves, overlay
from outrider.sweep.places import Array, Circles, obstacles, scatter, walk
from outrider.sweep.scenes import Scene, Things
from outrider.sweep.trouble import strike

_MARGIN = 10.0
"""Horizontal margin (m) of the planner's box around all starts, goals and the circle of the escort."""
_MIN_RADIUS = 4.0
"""Least radius (m) of the circle around an escorted target; the radius grows with the number of vehicles."""


class SceneParameters(NamedTuple):
    """Parameters of a scene at its difficulty, for a number of vehicles.

    They are the half width of the square in which the vehicles start (m), the speed (m/s), numbers of
    obstacles, and number, length (m) and interval (s) of jumps.
    """

    half: float
    speed: float
    spheres: int
    posts: int
    boxes: int
    jumps: int
    length: float
    every_s: float


def vehicles(scene: Scene, seed: int) -> int:
    """Return the number of vehicles that the seed draws."""
    return int(stream(seed, Stream.SCENE_FLEET).integers(scene.vehicles[0], scene.vehicles[1] + 1))


def scene_parameters(scene: Scene, count: int, seed: int) -> SceneParameters:
    """Return every parameter at the scene's difficulty, for ``count`` vehicles.

    If the scene bounds the total number of obstacles, the seed draws the number.
    """
    random = stream(seed, Stream.SCENE_COUNTS)

    def at(easy: float, hard: float) -> float:
        return easy + scene.difficulty * (hard - easy)

    def many(kind: Things | None) -> int:
        if kind is None:
            return 0
        if kind.per_vehicle is not None:
            return round(count * at(kind.per_vehicle.easy, kind.per_vehicle.hard))
        least, most = kind.count or (0, 0)
        return int(random.integers(least, most + 1))

    density = at(scene.density.easy, scene.density.hard)
    jumps = scene.jumps
    return SceneParameters(
        half=math.sqrt(100.0 * count / density) / 2.0,
        speed=round(at(scene.speed.easy, scene.speed.hard), 3),
        spheres=many(scene.spheres),
        posts=many(scene.posts),
        boxes=many(scene.boxes),
        jumps=0 if jumps is None else max(1, round(at(jumps.count.easy, jumps.count.hard))),
        length=0.0 if jumps is None else at(jumps.length.easy, jumps.length.hard),
        every_s=0.0 if jumps is None else round(at(jumps.every_s.easy, jumps.every_s.hard), 3),
    )


def draw(scene: Scene, seed: int) -> dict[str, JsonValue]:
    """Return the scenario of ``seed`` as the document of a scenario file.

    Raises InputError if there is no room for everything that it must contain.
    """
    count = vehicles(scene, seed)
    dial = scene_parameters(scene, count, seed)
    where = f"scene {scene.name!r}, seed {seed}"
    starts = scatter(stream(seed, Stream.SCENE_STARTS), scene, count, dial.half, f"{where}: start")
    document: dict[str, JsonValue] = {
        "name": f"{scene.name}-{seed}",
        "description": f"drawn from scene {scene.name} with seed {seed}, difficulty {scene.difficulty:g}",
        "task": scene.task,
        "vehicles": count,
        "airborne": True,
    }
    companion: dict[str, JsonValue] = {"task": scene.task}
    radius = 0.0
    if scene.task == "goto":
        goals = scatter(stream(seed, Stream.SCENE_GOALS), scene, count, dial.half, f"{where}: goal")
        extent, last_jump = dial.half, 0.0
        document["target"] = {"kind": "fixed", "at": [0.0, 0.0, 0.0]}
        kept = [Circles(np.vstack([starts, goals])[:, :2], np.zeros(2 * count))]
    else:
        goals = None
        radius = round(max(_MIN_RADIUS, count * scene.apart / (2.0 * math.pi)), 3)
        extent = max(dial.half, dial.length)
        places = walk(stream(seed, Stream.SCENE_TARGET), dial.jumps, dial.length, extent)
        last_jump = (dial.jumps - 1) * dial.every_s
        document["target"] = _target(places, dial.every_s)
        companion["surface"] = {"radius": radius}
        kept = [
            Circles(starts[:, :2], np.zeros(count)),
            Circles(places, np.full(len(places), radius), hollow=True),
        ]
    document["starts"] = {
        "kind": "points",
        "at": starts.tolist(),
        "goals": None if goals is None else goals.tolist(),
    }
    counts = dial.spheres, dial.posts, dial.boxes
    document["obstacles"] = obstacles(
        stream(seed, Stream.SCENE_OBSTACLES), scene, counts, extent, kept, where
    )
    reach = round(extent + radius + _MARGIN, 3)
    companion["limits"] = {
        "v_max": [dial.speed] * 3,
        "box_min": [-reach, -reach, max(0.5, scene.height[0] - 3.0)],
        "box_max": [reach, reach, scene.height[1] + 5.0],
    }
    document["companion"] = companion
    if scene.trouble is not None:
        struck = strike(scene.trouble, count, stream(seed, Stream.SCENE_TROUBLE))
        document = overlay(document, leaves(struck))
    # Time limit: the time of the last jump (0 without jumps), plus a minute, plus three times the duration of
    # the longest path at full speed; at most an hour.
    way = 2.0 * math.sqrt(2.0) * (extent + radius)
    document["cap_s"] = float(min(3600, math.ceil(last_jump + 60.0 + 3.0 * way / dial.speed)))
    return overlay(document, leaves(scene.scenario))


def _target(places: Array, every_s: float) -> dict[str, JsonValue]:
    jumps: list[JsonValue] = [
        {"after_s": round(k * every_s, 3), "to": [*place.tolist(), 0.0]} for k, place in enumerate(places[1:])
    ]
    return {"kind": "fixed", "at": [*places[0].tolist(), 0.0], "jumps": jumps}
