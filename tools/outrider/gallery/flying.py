"""Function that a worker runs for a flight of the gallery: its summary, and the data of the picture."""

from __future__ import annotations

from typing import Any

import numpy as np

from outrider.runs.ground_truth import Samples
from outrider.runs.outcome import Outcome
from outrider.runs.summary import standoff_errors
from outrider.scenarios.footprints import circles, rectangles
from outrider.simulation.preparation import measured
from outrider.sweep.flying import prepared
from outrider.sweep.tasks import Task

RUN = f"{__name__}:fly"
_SAMPLES_PER_POINT = 5
"""Number of samples of the ground truth per point of the picture: 0.1 s."""


def fly(task: Task) -> dict[str, Any]:
    """Fly a task without files; return its summary with ``scene``. The same task gives the same result."""
    outcome, summary = measured(prepared(task), task.seed)
    return {**summary, "scene": _scene(outcome)}


def _scene(outcome: Outcome) -> dict[str, Any]:
    """Return the data of the picture, rounded to cm because it goes into a journal.

    Times (T,) since the goal event (s); horizontal positions (T, K, 2) and the target's path (≤ T,
    2), without the times at which it is absent (m); the least separation (T,), m, or −1 where there is none;
    ``standoff``, of escorts only: median and largest of the vehicles' distances (T, 2), m, from the surface;
    round obstacles as (east, north, radius), and corners of boxes and walls (M, 4, 2); paths of moving
    obstacles (M, T, 2) and their radii; the number of vehicles without bystanders; d_min (m).
    """
    start = outcome.clock_start or 0
    samples = outcome.truth.samples(start, outcome.clock_end)
    near = samples.separation
    pieces = np.arange(0, len(near), _SAMPLES_PER_POINT)
    nearest = np.minimum.reduceat(near, pieces) if len(near) else near
    target = samples.target[::_SAMPLES_PER_POINT]
    return {
        "time_s": np.round((samples.time[::_SAMPLES_PER_POINT] - start) * 1e-6, 2).tolist(),
        "position": np.round(samples.position[::_SAMPLES_PER_POINT, :, :2], 2).tolist(),
        "separation": np.round(np.where(np.isfinite(nearest), nearest, -1.0), 2).tolist(),
        "standoff": _standoff(outcome, samples),
        "target": np.round(target[np.isfinite(target).all(axis=1)][:, :2], 2).tolist(),
        "obstacles": [list(circle) for circle in circles(outcome.scenario.obstacles)],
        "boxes": np.round(rectangles(outcome.scenario.obstacles), 2).tolist(),
        "moving": np.round(samples.moving[::_SAMPLES_PER_POINT, :, :2].swapaxes(0, 1), 2).tolist(),
        "moving_radius": [one.radius for one in outcome.scenario.moving],
        "vehicles": outcome.scenario.vehicles,
        "d_min": outcome.scenario.d_min,
    }


def _standoff(outcome: Outcome, samples: Samples) -> list[list[float]] | None:
    if outcome.scenario.task != "escort":
        return None
    some = slice(None, None, _SAMPLES_PER_POINT)
    errors = standoff_errors(outcome, samples.position[some], samples.target[some])
    # A target that is absent has no surface around it.
    there = np.where(np.isfinite(errors).any(axis=1, keepdims=True), errors, -1.0)
    found = np.stack([np.nanmedian(there, axis=1), np.nanmax(there, axis=1)], axis=1)
    rounded: list[list[float]] = np.round(found, 2).tolist()
    return rounded
