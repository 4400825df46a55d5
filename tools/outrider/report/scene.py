"""Scenery of the animated flight on the report's page: obstacles, goals and surfaces, as values for JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from outrider.report.run import Array, Motions, Run
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.starts import starts
from outrider.scene.airframe import HEXAROTOR, airframe
from outrider.scene.scene import Solid, solids

_MAX_SPAN = 100.0


def scene(run: Run, motions: Motions) -> dict[str, Any]:
    """Return the scene; lengths in m, fleet-local ENU.

    ``airframe`` is the vehicles' shape (``Airframe``), ``dMin`` the least distance of the scenario, None if
    it is unknown. ``fixed`` are spheres, posts and boxes (``Solid``), ``movers`` are in the order of the
    moving obstacles, ``surfaces`` are lines as offsets from the target, and ``bystanders`` is the number of
    these vehicles.
    """
    scenario, span = run.scenario, run.summary.get("span_m")
    frame = HEXAROTOR if scenario is None else airframe(scenario.vehicle)
    if isinstance(span, int | float) and 0.0 < span < _MAX_SPAN:
        frame = frame._replace(span=float(span))
    d_min = run.summary.get("d_min_m") if scenario is None else scenario.d_min
    return {
        "airframe": frame._asdict(),
        "dMin": float(d_min) if isinstance(d_min, int | float) else None,
        "fixed": [] if scenario is None else [_fixed(one) for one in solids(scenario.obstacles)],
        "movers": []
        if scenario is None
        else [dict(_mover(scenario, j)) for j in range(len(scenario.moving))],
        "goals": _goals(run, motions),
        "surfaces": [] if scenario is None else _surfaces(scenario),
        "bystanders": 0 if scenario is None else len(scenario.bystanders),
    }


def _fixed(solid: Solid) -> dict[str, object]:
    kind, at, radius, height, size, yaw = solid
    shape: dict[str, object] = {"kind": kind, "at": at}
    if kind == "box":
        return {**shape, "size": size, "yaw": round(yaw, 6)}
    return {**shape, "radius": radius, **({"height": height} if kind == "post" else {})}


def _mover(scenario: Scenario, j: int) -> Iterator[tuple[str, object]]:
    moving = scenario.moving[j]
    yield from (("kind", moving.kind), ("radius", moving.radius), ("id", scenario.moving_systems[j]))
    if moving.kind == "post":
        yield "height", moving.height


def _goals(run: Run, motions: Motions) -> list[list[float]]:
    scenario = run.scenario
    if scenario is None or len(motions.system) != scenario.size:
        return []
    goals = starts(scenario, run.seed or 0, scenario.companion.planar).goals
    return [] if goals is None else _rounded(goals)


def _surfaces(scenario: Scenario) -> list[dict[str, Any]]:
    """Return the fleet's surface, unless every vehicle has its own, and those of the vehicles.

    With another task than ``escort`` there are none.
    """
    companion = scenario.companion
    if companion.task != "escort":
        return []
    own = {one.vehicle: one.surface.outline() for one in companion.surfaces}
    shared = (
        [] if len(own) >= scenario.vehicles else [{"of": None, "line": _rounded(companion.surface.outline())}]
    )
    return shared + [{"of": system, "line": _rounded(line)} for system, line in sorted(own.items())]


def _rounded(values: Array) -> list[list[float]]:
    rounded: list[list[float]] = np.round(values, 3).tolist()
    return rounded
