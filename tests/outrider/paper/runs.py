"""Runs of the paper's table that take no time."""

from __future__ import annotations

from typing import Any

from outrider.paper.flying import TRACED
from outrider.sweep.cells import scenario_of
from outrider.sweep.tasks import Task


def table(task: Task) -> dict[str, Any]:
    """Baseline gets stuck, the others take as many seconds as their seed; tangential once comes too near."""
    of = scenario_of(task)
    method = of.companion.methods[0]
    stuck = method == "baseline"
    near = method == "tangential" and task.seed == 3
    result: dict[str, Any] = {
        "converged": not stuck,
        "convergence_time_s": None if stuck else float(task.seed),
        "min_separation_m": 0.4 if near else 1.0 + 0.1 * task.seed,
        "d_min_violations": int(near),
        "failure": None,
    }
    if task.seed == TRACED:
        result["trace"] = {
            "time_s": [0.0, 0.1],
            "position": [[[0.0, 0.0, 5.0]] * of.size, [[1.0, 0.0, 5.0]] * of.size],
            "gradient": [[3.0] * of.vehicles, [0.0] * of.vehicles],
            "target": [8.0, 0.0, 0.0],
        }
    return result


def fine(task: Task) -> dict[str, Any]:
    """As `table`, and nobody comes too near."""
    return {**table(task), "min_separation_m": 1.0, "d_min_violations": 0}
