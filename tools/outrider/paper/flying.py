"""Function that a worker runs for the paper's table: the flight, its summary, and its trace for figures."""

from __future__ import annotations

from typing import Any

import numpy as np

from outrider.runs.outcome import Outcome
from outrider.simulation.preparation import measured
from outrider.sweep.flying import prepared
from outrider.sweep.tasks import Task

RUN = f"{__name__}:fly"
TRACED = 1
"""Seed that is drawn."""
_SAMPLES_PER_POINT = 5
"""Number of samples of the ground truth for one point of the trace: 0.1 s."""


def fly(task: Task) -> dict[str, Any]:
    """Fly a task without files and return its summary. The same task gives the same result."""
    outcome, summary = measured(prepared(task), task.seed)
    return {**summary, "trace": _trace(outcome)} if task.seed == TRACED else dict(summary)


def _trace(outcome: Outcome) -> dict[str, Any]:
    """Return the trace of a flight, rounded to mm because it goes into a journal.

    It has times (T,) s after the goal event; positions (T, K, 3) m; ‖∇J‖ / Ω_t (T, vehicles) m of the plan
    before each time; and the final position of the target. Before a vehicle's first plan its ‖∇J‖ is that of
    the first plan.
    """
    start = outcome.clock_start or 0
    samples = outcome.truth.samples(start, outcome.clock_end)
    time = samples.time[::_SAMPLES_PER_POINT]
    steepness = []
    for log in outcome.plan_logs[: outcome.scenario.vehicles]:
        norms, index = np.linalg.norm(log.gradients, axis=1), np.searchsorted(log.times, time) - 1
        steepness.append(norms[np.clip(index, 0, len(norms) - 1)] if len(norms) else np.zeros(len(time)))
    return {
        "time_s": np.round((time - start) * 1e-6, 3).tolist(),
        "position": np.round(samples.position[::_SAMPLES_PER_POINT], 3).tolist(),
        "gradient": np.round(np.array(steepness).T, 3).tolist(),
        "target": np.round(samples.target[-1], 3).tolist() if len(samples.target) else None,
    }
