"""Check for scenarios that cannot work: what no companion could fly is refused before the flight."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from math import ceil, pi

import numpy as np

from companion.config.obstacles import Obstacle, Post, Wall
from companion.obstacles.static import FIRST_ID, FixedObstacles
from outrider.errors import InputError
from outrider.scenarios.part import FIRST_SYSTEM
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.starts import Array, places

_DENSEST = pi / 18.0**0.5
"""Largest share of a volume that equal balls fill, 0.74."""
_STEP_M = 0.1
"""Distance between the places of the way up to a start that are checked."""
_ANGLES = np.linspace(0.0, 2.0 * pi, 24, endpoint=False)
_AROUND = np.stack([np.cos(_ANGLES), np.sin(_ANGLES), np.zeros(len(_ANGLES))], axis=1)
"""Directions in which the edge of a column is checked."""


def obstacles_to(scenario: Scenario, span: float) -> Iterator[str]:
    """Yield a sentence for each reason why the vehicles, ``span`` (m) from tip to tip, cannot fly it.

    They are: starts or goals nearer to each other than vehicles are wide, starts or goals outside the box
    of the plans, a box too small for all vehicles, starts or goals nearer to an obstacle than its d_min, a
    d_min larger than what planners keep, and a world file that was not read.
    """
    kept = scenario.companion.field.d_min
    if scenario.vehicles > 1 and scenario.d_min > kept:
        yield (
            f"d_min: {scenario.d_min:g} m is more than vehicles keep, companion.field.d_min = {kept:g} m;"
            f" allowed: at most {kept:g}, or a larger companion.field.d_min"
        )
    if scenario.world is not None:
        yield f"world: {scenario.world} was not read; allowed: in a scenario file only"
    starts, goals = places(scenario)
    yield from in_obstacles(starts, goals, scenario)
    for name, found in (("start", starts), ("have goals", goals)):
        if found is not None:
            yield from _too_near(name, found, span)
    yield from _outside("starts", starts[: scenario.vehicles], scenario)
    if goals is not None:
        yield from _outside("has its goal", goals, scenario)
    limits = scenario.companion.limits
    size = np.array(limits.box_max) - np.array(limits.box_min)
    # Centres keep d_min from each other; a ball of that diameter may stand out of the box by half of it.
    room = float(np.prod(size + scenario.d_min))
    crowded = scenario.vehicles * pi / 6.0 * scenario.d_min**3 > _DENSEST * room
    if crowded or (scenario.vehicles > 1 and float(np.linalg.norm(size)) < scenario.d_min):
        sides = " × ".join(f"{side:g}" for side in size)
        yield (
            f"companion.limits: the box of {sides} m has no room for {scenario.vehicles} vehicles that keep"
            f" d_min = {scenario.d_min:g} m; allowed: a larger box"
        )


def in_obstacles(starts: Array, goals: Array | None, scenario: Scenario) -> Iterator[str]:
    """Yield a sentence for each of ``starts`` (K, 3) and ``goals``, m, too near to a fixed obstacle.

    The way up to a start from the ground counts with it; with committed plans all of the column in which the
    autopilot takes the vehicle up, ``certified.drift`` about its axis. With these no height above a post
    counts: no plane would keep a vehicle that begins there above it.
    """
    if not scenario.obstacles:
        return
    fixed = FixedObstacles(scenario.obstacles)
    for k, place in enumerate(starts):
        lowest = place[2] if scenario.airborne else 0.0
        climb = np.repeat(place[None], 1 + ceil(abs(place[2] - lowest) / _STEP_M), axis=0)
        climb[:, 2] = np.linspace(place[2], lowest, len(climb))
        who = f"vehicle {FIRST_SYSTEM + k}"
        found = list(_near_obstacle(f"{who} starts", climb, scenario, fixed))
        if not found and scenario.companion.avoidance == "certified" and not scenario.airborne:
            drift = scenario.companion.certified.drift
            column = (climb[:, None] + drift * _AROUND).reshape(-1, 3)
            what = f"{who} takes off, within certified.drift = {drift:g} m of its start,"
            found = list(_near_obstacle(what, np.vstack([climb, column]), scenario, fixed))
        yield from found
    for k, place in enumerate(() if goals is None else goals):
        yield from _near_obstacle(f"vehicle {FIRST_SYSTEM + k} has its goal", place[None], scenario, fixed)


def check_drawn(scenario: Scenario, seed: int, starts: Array) -> None:
    """Raise InputError if ``starts`` (K, 3), m, as drawn with ``seed``, are too near to an obstacle."""
    found = list(in_obstacles(starts, None, scenario))
    if found:
        raise InputError(*(f"seed {seed}: {what}" for what in found))


def _near_obstacle(what: str, points: Array, scenario: Scenario, fixed: FixedObstacles) -> Iterator[str]:
    """Yield a sentence if one of ``points`` (n, 3) is too near to an obstacle."""
    obstacles, least = scenario.obstacles, scenario.d_min_obstacle
    endless = scenario.companion.avoidance == "certified"
    for index in (name - FIRST_ID for name in fixed.around(points, least).ids):
        one = obstacles[index]
        solid = one.endless if endless and isinstance(one, Post) else one
        level = solid is not one
        apart = float(FixedObstacles([solid]).distance(points).min())
        if apart < least:
            at = ", ".join(f"{value:g}" for value in np.round(points[0], 2))
            inside, beside = ("above or inside", " horizontally") if level else ("inside", "")
            where = inside if apart < 0.0 else f"{apart:.2f} m{beside} from"
            yield (
                f"{what} at [{at}] {where} obstacles[{index}], {described(one)};"
                f" allowed: at least d_min_obstacle = {least:g} m{beside} from it"
            )
            return


def described(obstacle: Obstacle) -> str:
    """Return the kind of an obstacle, and where it is."""
    if isinstance(obstacle, Wall):
        return "a wall from [{:g}, {:g}] to [{:g}, {:g}]".format(*obstacle.ends[0], *obstacle.ends[1])
    return f"a {obstacle.kind} at [{', '.join(f'{value:g}' for value in obstacle.at)}]"


def _too_near(what: str, found: Array, span: float) -> Iterator[str]:
    for (j, one), (k, other) in combinations(enumerate(found), 2):
        apart = float(np.linalg.norm(one - other))
        if apart < span:
            yield (
                f"vehicles {FIRST_SYSTEM + j} and {FIRST_SYSTEM + k} {what} {apart:.2f} m from each other;"
                f" allowed: at least the {span:.2f} m that they are wide"
            )
            return


def _outside(what: str, found: Array, scenario: Scenario) -> Iterator[str]:
    limits = scenario.companion.limits
    for k, place in enumerate(found):
        for axis, value, low, high in zip(
            ("east", "north", "up"), place, limits.box_min, limits.box_max, strict=True
        ):
            if not low <= value <= high:
                yield (
                    f"vehicle {FIRST_SYSTEM + k} {what} {value:g} m {axis}, outside companion.limits;"
                    f" allowed: {low:g} to {high:g} m {axis}"
                )
                return
