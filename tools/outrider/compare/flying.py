"""Function that a worker runs for a comparison: the flight and its figures."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from outrider.compare.measures import document, figures
from outrider.compare.scene import Scene, scenario_of
from outrider.processes.processor import processor
from outrider.resources import config_root
from outrider.runs.outcome import Outcome
from outrider.simulation.flight import Flight
from outrider.sweep.tasks import Task
from sitl.vehicle.config import VehicleConfig

RUN = f"{__name__}:fly"
TRACED = 1
"""Seed that is drawn."""
_SAMPLES_PER_POINT = 5
"""Number of samples of the ground truth for one point of the trace: 0.1 s."""


def fly(task: Task) -> dict[str, Any]:
    """Fly a task without files; return its figures.

    All but the CPU times and the processor are the same for the same task.
    """
    scene = Scene.model_validate_json(task.document)
    vehicle = VehicleConfig.model_validate_json(task.vehicle, strict=True)
    flight = Flight(
        scenario_of(scene, task.seed),
        vehicle,
        task.seed,
        config_root() / "logs",
        stopwatch=time.thread_time_ns,
    )
    flight.run()
    outcome = flight.outcome
    has_jerk = vehicle.motion == "multirotor" or vehicle.point_window_us > 0
    found = document(figures(outcome, scene.measure, scene.goal_radius, has_jerk=has_jerk))
    found |= _planning(outcome)
    obstacle = outcome.truth.obstacles.minimum
    found |= {"obstacle_m": round(float(obstacle), 4) if np.isfinite(obstacle) else None}
    found |= {"d_min_violations": outcome.truth.vehicles.count, "failure": outcome.failure}
    found |= {"processor": processor()}
    return {**found, **_traces(outcome)} if task.seed == TRACED else found


def _planning(outcome: Outcome) -> dict[str, Any]:
    """Return the CPU times (ms) and the counters of the planners, from the goal event on."""
    tallies = outcome.tallies
    took = np.array([ns for before, after in tallies for ns in after.plan_ns[len(before.plan_ns) :]]) * 1e-6
    levels = {"plan_ms_p50": 50.0, "plan_ms_p99": 99.0, "plan_ms_max": 100.0}
    return {
        **{
            name: round(float(np.percentile(took, q)), 4) if len(took) else None for name, q in levels.items()
        },
        "plans": sum(after.plans - before.plans for before, after in tallies),
        "held_epochs": sum(after.held - before.held for before, after in tallies),
        "solver_failures": sum(after.solver_failures for _, after in tallies),
        "left_tube": sum(after.left_tube - before.left_tube for before, after in tallies),
        "anchored_anew": sum(after.anchored_anew - before.anchored_anew for before, after in tallies),
    }


def _traces(outcome: Outcome) -> dict[str, Any]:
    """Return the ``trace`` of the vehicles (T, K, 3), m, and that of obstacles that are ``moving`` (T, M, 3).

    They have positions every 0.1 s, in mm because they go into a journal.
    """
    samples = outcome.truth.samples(outcome.clock_start or 0, outcome.clock_end)
    arrays = {"trace": samples.position}
    if outcome.scenario.moving:
        arrays["moving"] = samples.moving
    return {name: np.round(of[::_SAMPLES_PER_POINT], 3).tolist() for name, of in arrays.items()}
