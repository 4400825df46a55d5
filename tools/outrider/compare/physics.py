"""A comparison in full physics: its scene with a vehicle that has rotors, and its limits and distances."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from companion.avoidance.certified.margins import between, from_surfaces
from companion.config import CompanionConfig
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
    its plans, and drawn worlds have ways for it, in each row with the row's own values. There are no bars,
    which are for points. What is not alike for points only is replaced by the part's own differences. Raises
    InputError without such a part, for a row that sets the vehicle or a distance of its own, and where the
    scene is too narrow for the vehicle.
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
    base = load(where.parent / comparison.scenario, Scenario).model_dump(mode="json")
    apart, clear = _kept(base, where, values)
    measure = comparison.measure
    found = Measure(
        kind="ball" if measure.kind == "box" else measure.kind,
        least=span,
        downwash=measure.downwash,
        obstacle=None if measure.obstacle is None else span / 2.0,
    )
    rows = []
    for row in comparison.rows:
        if taken := sorted(own.keys() & row.set.keys()):
            raise InputError(
                f"--physics: the row {row.label!r} sets {taken[0]}, which the vehicle decides; allowed: a"
                " row without it"
            )
        apart_here, clear_here = _kept(base, where, {**values, **row.set}) if row.set else (apart, clear)
        missions = _farther(row.missions or comparison.missions, apart_here)
        world = _passable(row.world or comparison.world, clear_here, name)
        rows.append(row.model_copy(update={"bar": None, "missions": missions, "world": world}))
    note = _note(name, span, apart, clear, measure.obstacle is not None)
    return comparison.model_copy(
        update={
            "name": f"{comparison.name}-physics",
            "measure": found,
            "set": values,
            "rows": tuple(rows),
            "missions": _farther(comparison.missions, apart),
            "world": _passable(comparison.world, clear, name),
            "points": (),
            "differences": (note, *comparison.physics.differences, *comparison.differences),
        }
    )


def _vehicle(name: str) -> VehicleConfig:
    """Return the vehicle; raises InputError for a point."""
    found = load(find("vehicles", name), VehicleConfig)
    if found.motion == "point":
        raise InputError(f"physics.vehicle: {name} is a point; allowed: a vehicle with rotors that moves it")
    return found


def _kept(base: Mapping[str, Any], where: Path, values: Mapping[str, Any]) -> tuple[float, float]:
    """Return the least distances (m) of two plans, and of a plan from surfaces, with ``values`` set.

    They follow from the companion's settings alone. The whole scenario is checked with its drawn starts.
    """
    document = json.dumps(overlay(base, values)["companion"]).encode()
    config = read(document, f"{where}: physics, companion", CompanionConfig)
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
