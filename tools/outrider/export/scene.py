"""3-D scene of a flight for Foxglove's 3-D panel: moving frames, and bodies fixed to them.

Bodies are written once, each fixed to a frame: ``fleet`` (ENU), ``vehicle-N``, ``target``, ``moving-N``. A
viewer that jumps to any time therefore shows all bodies, and only frames and trails are written repeatedly.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import cos, radians, sin
from typing import Final, NamedTuple

import numpy as np

from companion.config.obstacles import Box, Post, Sphere
from outrider.export import foxglove, foxglove_schemas, multirotor
from outrider.export.attitude import quaternions, up_vectors
from outrider.export.foxglove import Color, Json
from outrider.export.mcap_file import Entry, entry
from outrider.palette import OBSTACLE, TARGET, hex_of, rgb
from outrider.runs.arrays import Array, Motion
from outrider.scenarios.footprints import without_walls
from outrider.scenarios.moving import MovingPostPart
from outrider.scenarios.scenario import Scenario
from outrider.scene.airframe import Airframe, airframe

FLEET: Final = "fleet"
SHELL = 0.12
"""Opacity of the shells that are d_min wide."""
TRAIL_US, TRAIL_EVERY_US, TRAIL_POINT = 10_000_000, 200_000, 5
"""Length of a trail (µs), its drawing period (µs), and the stride of its samples."""
_IDENTITY = (1.0, 0.0, 0.0, 0.0)


class Stage(NamedTuple):
    """Input of a scene: the scenario, the recorded motion, and the reported lean of the vehicles.

    The lean is by system id, see ``attitude.leanings``.
    """

    scenario: Scenario
    motion: Motion
    said: Mapping[int, tuple[Array, Array]]


def bodies(stage: Stage) -> Iterator[Entry]:
    """Yield all bodies of constant shape, and the complete paths, at the time of the first sample."""
    scenario, motion = stage.scenario, stage.motion
    if not len(motion.time):
        return
    now = int(motion.time[0])
    frame = airframe(scenario.vehicle)

    def reported(topic: str, *entities: Json) -> Entry:
        return entry(now, f"/scene/{topic}", foxglove_schemas.SCENE_UPDATE, foxglove.update(*entities))

    paint = colors(scenario)
    vehicles = [_vehicle(now, system, frame, scenario.d_min, paint[system]) for system in scenario.systems]
    yield reported("vehicles", *vehicles)
    yield reported("paths", *_paths(stage, paint))
    if np.isfinite(motion.target).any():
        yield reported("target", _target(now, scenario))
    if scenario.obstacles:
        solid = [
            foxglove.entity(now, FLEET, f"obstacle-{k}", _obstacle(one, scenario.d_min_obstacle))
            for k, one in enumerate(without_walls(scenario.obstacles))
        ]
        yield reported("obstacles", *solid)
    if scenario.moving:
        yield reported("moving", *_moving(now, scenario))


def frames(stage: Stage) -> Iterator[Entry]:
    """Yield the transforms of all frames at each sample. A frame without a finite position is omitted."""
    scenario, motion = stage.scenario, stage.motion
    turned = [
        quaternions(motion.yaw[:, k].astype(np.float64), up_vectors(motion, k, stage.said.get(system)))
        for k, system in enumerate(scenario.systems)
    ]
    names = [f"vehicle-{system}" for system in scenario.systems]
    for row, time in enumerate(motion.time.tolist()):
        found = [(name, motion.position[row, k], turned[k][row].tolist()) for k, name in enumerate(names)]
        found.append(("target", motion.target[row], _IDENTITY))
        found += [
            (f"moving-{system}", motion.moving[row, k], _IDENTITY)
            for k, system in enumerate(scenario.moving_systems)
        ]
        there = [
            foxglove.transform(time, FLEET, name, at.tolist(), quaternion)
            for name, at, quaternion in found
            if np.isfinite(at).all()
        ]
        yield entry(time, "/tf", foxglove_schemas.FRAME_TRANSFORMS, {"transforms": there})


def trails(stage: Stage) -> Iterator[Entry]:
    """Yield the paths of the vehicles over the last ten seconds, five times a second."""
    motion, paint = stage.motion, colors(stage.scenario)
    due = -1
    for row, time in enumerate(motion.time.tolist()):
        if time < due:
            continue
        due = time + TRAIL_EVERY_US
        first = int(np.searchsorted(motion.time, time - TRAIL_US))
        # The same samples are chosen each time, so that a trail does not jitter.
        chosen = [*range(-(-first // TRAIL_POINT) * TRAIL_POINT, row, TRAIL_POINT), row]
        drawn = [
            foxglove.entity(
                time,
                FLEET,
                f"trail-{system}",
                {"lines": [foxglove.line(motion.position[chosen, k].tolist(), 2.0, paint[system])]},
            )
            for k, system in enumerate(stage.scenario.systems)
            if np.isfinite(motion.position[chosen, k]).all()
        ]
        yield entry(time, "/scene/trails", foxglove_schemas.SCENE_UPDATE, foxglove.update(*drawn))


def colors(scenario: Scenario) -> dict[int, Color]:
    """Return the colour of each vehicle by system id, as in all pictures."""
    return {system: Color.of(rgb(hex_of(k, scenario.vehicles))) for k, system in enumerate(scenario.systems)}


TARGET_COLOR, SOLID_COLOR = Color.of(rgb(TARGET)), Color.of(rgb(OBSTACLE))


def _vehicle(now: int, system: int, frame: Airframe, d_min: float, color: Color) -> Json:
    """Return a multirotor inside a shell of diameter d_min.

    The centres of two vehicles whose shells touch are d_min apart.
    """
    return foxglove.entity(
        now,
        f"vehicle-{system}",
        f"vehicle-{system}",
        {
            **multirotor.shapes(frame, color),
            "spheres": [foxglove.sphere((0.0, 0.0, 0.0), d_min, color.faint(SHELL))],
            "texts": [foxglove.label((0.0, 0.0, frame.span), str(system), 0.5 * frame.span, color)],
        },
        locked=True,
    )


def _target(now: int, scenario: Scenario) -> Json:
    spheres = [foxglove.sphere((0.0, 0.0, 0.0), 0.4, TARGET_COLOR)]
    if scenario.d_min_target is not None:
        spheres.append(
            foxglove.sphere((0.0, 0.0, 0.0), 2.0 * scenario.d_min_target, TARGET_COLOR.faint(SHELL))
        )
    return foxglove.entity(now, "target", "target", {"spheres": spheres}, locked=True)


def _obstacle(one: Sphere | Post | Box, d_min: float) -> dict[str, list[Json]]:
    """Return a ball, a box, or a post from the ground up, and its shell, which no vehicle's centre may enter.

    The shell of a box is wider than d_min at its edges, which are not round.
    """
    if isinstance(one, Box):
        return _box(one, d_min)
    if isinstance(one, Post):
        return _post((one.at[0], one.at[1], 0.5 * one.height), one.radius, one.height, d_min)
    return _ball(one.at, one.radius, d_min)


def _moving(now: int, scenario: Scenario) -> Iterator[Json]:
    for system, one in zip(scenario.moving_systems, scenario.moving, strict=True):
        if isinstance(one, MovingPostPart):
            # The frame moves along the ground.
            shapes = _post((0.0, 0.0, 0.5 * one.height), one.radius, one.height, scenario.d_min_obstacle)
        else:
            shapes = _ball((0.0, 0.0, 0.0), one.radius, scenario.d_min_obstacle)
        yield foxglove.entity(now, f"moving-{system}", f"moving-{system}", shapes, locked=True)


def _box(box: Box, d_min: float) -> dict[str, list[Json]]:
    half = 0.5 * radians(box.yaw_deg)
    turned = (cos(half), 0.0, 0.0, sin(half))
    sizes = ((0.0, SOLID_COLOR), (2.0 * d_min, SOLID_COLOR.faint(SHELL)))
    return {
        "cubes": [
            foxglove.cube(box.at, [side + wider for side in box.size], color, turned)
            for wider, color in sizes
        ]
    }


def _post(middle: foxglove.Point, radius: float, height: float, d_min: float) -> dict[str, list[Json]]:
    sizes = ((radius, SOLID_COLOR), (radius + d_min, SOLID_COLOR.faint(SHELL)))
    return {"cylinders": [foxglove.cylinder(middle, 2.0 * size, height, color) for size, color in sizes]}


def _ball(middle: foxglove.Point, radius: float, d_min: float) -> dict[str, list[Json]]:
    sizes = ((radius, SOLID_COLOR), (radius + d_min, SOLID_COLOR.faint(SHELL)))
    return {"spheres": [foxglove.sphere(middle, 2.0 * size, color) for size, color in sizes]}


def _paths(stage: Stage, paint: Mapping[int, Color]) -> Iterator[Json]:
    motion = stage.motion
    ways = [
        (f"path-{system}", motion.position[::TRAIL_POINT, k], paint[system])
        for k, system in enumerate(stage.scenario.systems)
    ]
    ways.append(("path-target", motion.target[::TRAIL_POINT], TARGET_COLOR))
    for name, way, color in ways:
        there = way[np.isfinite(way).all(axis=1)]
        if len(there):
            line = foxglove.line(there.tolist(), 1.0, color.faint(0.4))
            yield foxglove.entity(int(motion.time[0]), FLEET, name, {"lines": [line]})
