"""A comparison in full physics: its scene with a vehicle that has rotors, and its limits and distances."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from companion.avoidance.certified.margins import between, from_surfaces
from outrider.compare.comparison import Comparison, Measure, Missions
from outrider.compare.world import Maze, World
from outrider.errors import InputError
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.sweep.grid import overlay
from outrider.yaml_files.yaml_file import load, read
from sitl.vehicle.config import VehicleConfig


def in_physics(comparison: Comparison, where: Path) -> Comparison:
    """Return ``comparison``, of the file ``where``, with the vehicle of its part ``physics``.

    Two vehicles keep the vehicle's span, centres half of it from obstacles. Drawn starts are as far apart as
    its plans, and drawn worlds have ways for it. There are no bars, which are for points. Raises InputError
    without such a part, and where the scene is too narrow for the vehicle.
    """
    if comparison.physics is None:
        raise InputError(
            f"--physics: {comparison.name} has no part physics; allowed: one with it, or no --physics"
        )
    name, span = comparison.physics.vehicle, _vehicle(comparison.physics.vehicle).span
    own: dict[str, Any] = {
        "vehicle": name,
        "d_min": span,
        "companion.field.d_min": span,
        "d_min_obstacle": span / 2.0,
        "companion.certified.d_min_obstacle": span / 2.0,
    }
    values = {**comparison.set, **comparison.physics.set, **own}
    apart, clear = _kept(comparison, where, values)
    measure = comparison.measure
    found = Measure(
        kind="ball" if measure.kind == "box" else measure.kind,
        least=span,
        downwash=measure.downwash,
        obstacle=None if measure.obstacle is None else span / 2.0,
    )
    rows = tuple(
        row.model_copy(
            update={
                "bar": None,
                "missions": _farther(row.missions, apart),
                "world": _passable(row.world, clear, name),
            }
        )
        for row in comparison.rows
    )
    return comparison.model_copy(
        update={
            "name": f"{comparison.name}-physics",
            "measure": found,
            "set": values,
            "rows": rows,
            "missions": _farther(comparison.missions, apart),
            "world": _passable(comparison.world, clear, name),
            "differences": (_note(name, span, apart, clear, measure.obstacle is not None),),
        }
    )


def _vehicle(name: str) -> VehicleConfig:
    """Return the vehicle; raises InputError for a point."""
    found = load(find("vehicles", name), VehicleConfig)
    if found.motion == "point":
        raise InputError(f"physics.vehicle: {name} is a point; allowed: a vehicle with rotors that moves it")
    return found


def _kept(comparison: Comparison, where: Path, values: Mapping[str, Any]) -> tuple[float, float]:
    """Return the least distances (m) of two plans, and of a plan from surfaces."""
    base = load(where.parent / comparison.scenario, Scenario).model_dump(mode="json")
    document = json.dumps(overlay(base, values)).encode()
    config = read(document, f"{where}: physics", Scenario).companion
    terms = config.certified, config.field, config.limits
    return between(*terms), from_surfaces(*terms)


def _farther(missions: Missions | None, apart: float) -> Missions | None:
    if missions is None or missions.apart >= apart:
        return missions
    return missions.model_copy(update={"apart": apart})


def _passable(world: World | None, clear: float, name: str) -> World | None:
    """Return the world with ways that are ``clear`` (m) of surfaces; raises InputError for narrower lanes."""
    if world is None:
        return None
    if isinstance(world, Maze):
        if world.cell <= 2.0 * clear:
            raise InputError(
                f"--physics: the lanes of the maze are {world.cell:g} m wide, too narrow for {name}, whose"
                f" plans keep {clear:.3f} m from surfaces (half its span, tube and clock); allowed: more than"
                f" {2.0 * clear:.3f} m"
            )
        return world
    return world.model_copy(update={"passable": max(world.passable, clear), "clear": max(world.clear, clear)})


def _note(name: str, span: float, apart: float, clear: float, obstacles: bool) -> str:
    surfaces = f", centres {span / 2.0:g} m from surfaces, their plans {clear:.3f} m" if obstacles else ""
    return (
        f"In full physics: the vehicles are of the kind {name}, {span:g} m from tip to tip, with limits of"
        f" their own; theirs are points, or simulated vehicles of another size. Two centres keep {span:g} m,"
        f" their plans {apart:.3f} m{surfaces}. Drawn starts and worlds are the points' where they leave that"
        " room."
    )
