"""Static content of a 3D view: vehicles, obstacles, and what the view may change."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.config.obstacles import Box, Obstacle, Post, Sphere
from outrider.scenarios.footprints import without_walls
from outrider.scenarios.moving import MovingPostPart
from outrider.scenarios.scenario import FixedTarget, Scenario
from outrider.scenarios.starts import starts
from outrider.scene.airframe import HEXAROTOR, Airframe

Array = NDArray[np.float64]
Lever = Literal["pace", "methods", "loss", "target"]
LEAST_REACH = 4.0
"""m: smallest reach of a view."""


class Solid(NamedTuple):
    """A ball or a box around ``at``, or a post that stands on the ground at ``at``; m.

    ``size``: lengths of a box along its own axes, which are turned by ``yaw`` (rad) from east to north.
    """

    kind: Literal["sphere", "post", "box"]
    at: tuple[float, float, float]
    radius: float = 0.0
    height: float = 0.0
    size: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = 0.0


class Scene(NamedTuple):
    """Static content of a view; lengths in m, fleet-local ENU.

    ``systems`` (K): ids of the vehicles, of which the first ``tasked`` fly the task; ``airframe``: their
    shape. ``d_min``: least allowed distance between vehicles' centres; ``d_safe``: distance between centres
    below which the repulsive field acts; ``d_min_target``: least allowed distance to the target; None where a
    distance is not known or does not apply. ``d_min_solid``: least allowed distance from a centre to an
    obstacle's surface. ``movers`` (M): shapes of the moving obstacles. ``goals`` (k, 3). ``surfaces``: closed
    lines (n, 3) as offsets from the target. ``centre`` (3,) and ``reach``: the initial centre of the view,
    and the distance from there within which the content lies. ``follows``: whether the view moves along with
    the vehicles. ``step_s``: step of plans with separating planes; None for a fleet without them. ``levers``:
    what the view may change, ``methods`` and ``loss`` as they are at first.
    """

    title: str
    systems: tuple[int, ...]
    tasked: int
    airframe: Airframe = HEXAROTOR
    d_min: float | None = None
    d_safe: float | None = None
    d_min_target: float | None = None
    d_min_solid: float = 0.0
    solids: tuple[Solid, ...] = ()
    movers: tuple[Solid, ...] = ()
    goals: Array = np.empty((0, 3))
    surfaces: tuple[Array, ...] = ()
    centre: tuple[float, float, float] = (0.0, 0.0, 2.0)
    reach: float = 10.0
    follows: bool = False
    step_s: float | None = None
    levers: frozenset[Lever] = frozenset()
    methods: str = ""
    loss: float = 0.0


def staged(scenario: Scenario, seed: int, airframe: Airframe, levers: frozenset[Lever]) -> Scene:
    """Return the scene of ``scenario`` for a seed; ``airframe`` is the vehicles' shape."""
    companion = scenario.companion
    begin = starts(scenario, seed, companion.planar)
    goals = np.empty((0, 3)) if begin.goals is None else np.asarray(begin.goals, dtype=np.float64)
    certified = companion.avoidance == "certified"
    places = np.vstack([begin.positions, goals])
    if isinstance(scenario.target, FixedTarget):
        places = np.vstack([places, scenario.target.at, scenario.target.jump_to or scenario.target.at])
    low, high = places.min(axis=0), places.max(axis=0)
    centre = 0.5 * (low + high)
    return Scene(
        f"{scenario.name} (points, no physics)" if airframe.point else scenario.name,
        tuple(scenario.systems),
        scenario.vehicles,
        airframe,
        scenario.d_min,
        companion.field.d_safe,
        scenario.d_min_target,
        scenario.d_min_obstacle,
        solids(scenario.obstacles),
        tuple(
            Solid("post", (0.0, 0.0, 0.0), one.radius, one.height)
            if isinstance(one, MovingPostPart)
            else Solid("sphere", (0.0, 0.0, 0.0), one.radius)
            for one in scenario.moving
        ),
        goals,
        _surfaces(scenario),
        (float(centre[0]), float(centre[1]), float(centre[2])),
        max(float(np.linalg.norm(0.5 * (high - low))), LEAST_REACH),
        not isinstance(scenario.target, FixedTarget),
        1e-6 * companion.certified.dt_us if certified else None,
        levers - {"methods"} if certified else levers,
        "+".join(companion.methods),
        scenario.links.swarm.loss,
    )


def solids(obstacles: Sequence[Obstacle]) -> tuple[Solid, ...]:
    """Return the shapes and places of fixed obstacles, in their order."""
    return tuple(map(_solid, without_walls(obstacles)))


def _solid(obstacle: Sphere | Post | Box) -> Solid:
    if isinstance(obstacle, Box):
        return Solid("box", obstacle.at, size=obstacle.size, yaw=radians(obstacle.yaw_deg))
    if isinstance(obstacle, Post):
        return Solid("post", (*obstacle.at, 0.0), obstacle.radius, obstacle.height)
    return Solid("sphere", obstacle.at, obstacle.radius)


def _surfaces(scenario: Scenario) -> tuple[Array, ...]:
    """Return the fleet's surface, and those of vehicles that have their own; empty unless escorting."""
    companion = scenario.companion
    if companion.task != "escort":
        return ()
    own = [one.surface.outline() for one in companion.surfaces]
    return (*([companion.surface.outline()] if len(own) < scenario.vehicles else []), *own)
