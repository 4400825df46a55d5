"""Flights of the gallery that take no time."""

from __future__ import annotations

from typing import Any

from outrider.errors import OutriderError
from outrider.scenarios.footprints import circles, rectangles
from outrider.scenarios.scenario import Scenario
from outrider.sweep.cells import scenario_of
from outrider.sweep.tasks import Task


def straight(task: Task) -> dict[str, Any]:
    """Two samples of everybody; baseline gets stuck, swivel has no flight, and certified comes too near."""
    of = scenario_of(task)
    method, certified = of.companion.methods[0], of.companion.avoidance == "certified"
    if method == "swivel":
        raise OutriderError("no flight")
    return _summary(of, stuck=method == "baseline", near=certified)


def fine(task: Task) -> dict[str, Any]:
    """All converge."""
    return _summary(scenario_of(task), stuck=False, near=False)


def _summary(of: Scenario, *, stuck: bool, near: bool) -> dict[str, Any]:
    start = [[float(k), 0.0] for k in range(of.size)]
    end = [[float(k), 1.0] for k in range(of.size)]
    return {
        "converged": not stuck,
        "convergence_time_s": None if stuck else 7.25,
        "min_separation_m": 0.4 if near else 1.5,
        "d_min_violations": int(near),
        "failure": None,
        "scene": {
            "time_s": [0.0, 0.1],
            "position": [start, end],
            "separation": [-1.0, 1.5],
            "target": [[0.0, 8.0]],
            "obstacles": [list(one) for one in circles(of.obstacles)],
            "boxes": rectangles(of.obstacles).tolist(),
            "moving": [[[0.0, 0.0], [1.0, 1.0]] for _ in of.moving],
            "moving_radius": [one.radius for one in of.moving],
            "vehicles": of.vehicles,
            "d_min": of.d_min,
        },
    }
