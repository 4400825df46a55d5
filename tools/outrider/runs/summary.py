"""Summary of a run: one JSON object, on whose keys scripts rely."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.config.target_source import FusedSource
from outrider.runs.crash_check import first_fall
from outrider.runs.formation_error import standoff
from outrider.runs.ground_truth import Samples
from outrider.runs.outcome import Outcome
from outrider.runs.perception import bearings_quality, counts, estimates

Array = NDArray[np.float64]
Value = float | int | str | bool | None | dict[str, float] | dict[str, float | None] | dict[str, int]

WALL_FIELDS = ("plan_ms", "wall_s", "cpu_s", "real_time_factor", "run_dir")
"""Keys that may differ between two lock-step runs of one seed."""


class Cost(NamedTuple):
    """Time that the run took, s."""

    wall: float
    cpu: float


def summarise(flight: Outcome, cost: Cost, run_dir: Path | None) -> dict[str, Value]:
    """Return the summary of a finished flight.

    Errors, speeds and plan counters cover the time from the clock's start to its end; separation, messages,
    solver failures and relaxed QPs cover the whole flight. Values that do not apply are null.
    """
    scenario, truth = flight.scenario, flight.truth
    config = scenario.companion
    start, count = flight.clock_start, scenario.vehicles
    samples = truth.samples(start if start is not None else 0, flight.clock_end)
    everything = truth.samples()
    tallies = flight.tallies
    plan_ms = _ns_to_ms([after.plan_ns[len(before.plan_ns) :] for before, after in tallies])
    simulated = float(everything.time[-1] - everything.time[0]) * 1e-6 if len(everything.time) else 0.0
    converged: bool | None = None
    seconds: float | None = None
    others: float | None = None
    able: float | None = None
    if scenario.has_goal:
        converged = flight.converged_at is not None
        seconds = _since(start, flight.converged_at)
        others = _since(start, flight.others_converged_at)
        able = _since(start, flight.able_converged_at)
    late = flight.punctuality
    near_target = truth.target.minimum if scenario.d_min_target is not None else float("inf")
    return {
        "scenario": scenario.name,
        "method": "+".join(config.methods),
        "avoidance": config.avoidance,
        "planar": config.planar,
        "turning_sense": config.turning_sense if set(config.methods) - {"baseline"} else "own",
        "seed": flight.seed,
        "vehicles": scenario.size,
        "sensors": scenario.sensors,
        "converged": converged,
        "convergence_time_s": seconds,
        "others_converge_s": others,
        "covered_goals": flight.covered,
        "uncovered_converge_s": able,
        "min_separation_m": _finite(truth.vehicles.minimum),
        "min_obstacle_distance_m": _finite(truth.obstacles.minimum),
        "min_target_distance_m": _finite(near_target),
        "d_min_m": scenario.d_min,
        "downwash": config.field.downwash,
        "d_min_target_m": scenario.d_min_target,
        "span_m": flight.span,
        "motion": flight.motion,
        "d_min_obstacle_m": scenario.d_min_obstacle if scenario.obstacles or scenario.moving else None,
        "d_min_violations": truth.vehicles.count + truth.target.count + truth.obstacles.count,
        "max_speed_m_s": _largest(np.linalg.norm(samples.velocity, axis=-1)),
        "max_acceleration_m_s2": _largest(np.linalg.norm(samples.acceleration, axis=-1)),
        "max_tilt_deg": _largest(np.degrees(samples.tilt)),
        "yaw_error_deg": _percentiles(
            yaw_errors(samples.position[:, :count], samples.yaw[:, :count], samples.target), 50, 95
        ),
        "standoff_error_m": _percentiles(standoff_errors(flight, samples.position, samples.target), 50, 95),
        "plan_ms": _percentiles(plan_ms, 50, 99, "max"),
        "plans": sum(after.plans - before.plans for before, after in tallies),
        "solver_failures": sum(after.solver_failures for _, after in tallies),
        "relaxed_qps": sum(after.relaxed for _, after in tallies),
        "held_epochs": sum(after.held - before.held for before, after in tallies),
        "anchored_anew": sum(after.anchored_anew - before.anchored_anew for before, after in tallies),
        "slack_max_m": None,
        "tracking_error_m": _percentiles(
            np.linalg.norm(samples.position + samples.estimate_error - samples.reference, axis=-1), 95, "max"
        ),
        "estimate_error_m": _percentiles(np.linalg.norm(samples.estimate_error, axis=-1), 95, "max"),
        **_perception(flight, samples),
        "messages": flight.messages._asdict(),
        "deadline_misses": None if late is None else late.misses,
        "deadline_steps": None if late is None else late.deadlines,
        "lateness_ms": None
        if late is None
        else {"p50": round(late.p50_ms, 3), "p99": round(late.p99_ms, 3), "max": round(late.max_ms, 3)},
        "failure": "; ".join(filter(None, (flight.failure, first_fall(flight)))) or None,
        "simulated_s": round(simulated, 3),
        "wall_s": round(cost.wall, 3),
        "cpu_s": round(cost.cpu, 3),
        "real_time_factor": round(simulated / cost.wall, 2) if cost.wall > 0 else 0.0,
        "run_dir": None if run_dir is None else str(run_dir),
    }


def _perception(flight: Outcome, samples: Samples) -> dict[str, Value]:
    """Return the figures of fused detections and of the bearings; null without ``target_source: fused``."""
    scenario = flight.scenario
    if not isinstance(scenario.companion.target_source, FusedSource):
        names = "target_error_m", "nees", "information_ratio", "anisotropy", "seen_by", "detections"
        return dict.fromkeys(names)
    known = estimates(flight, samples)
    shares, ratios = bearings_quality(scenario, samples)
    nees = known.nees
    seen = known.seen_by
    return {
        "target_error_m": _percentiles(np.linalg.norm(known.errors, axis=-1), 50, 95, "max"),
        "nees": round(float(nees.mean()), 3) if len(nees) else None,
        "information_ratio": _percentiles(ratios, 50, 95),
        "anisotropy": _percentiles(shares, 50, 95),
        "seen_by": {
            "p50": float(np.median(seen)) if len(seen) else None,
            "min": float(seen.min()) if len(seen) else None,
        },
        "detections": counts(flight)._asdict(),
    }


def _since(start: int | None, at: int | None) -> float | None:
    """Return the time (s) from ``start`` to ``at`` (µs); None if one is missing."""
    return None if start is None or at is None else round((at - start) * 1e-6, 3)


def exit_status(summary: dict[str, Value]) -> int:
    """Return the exit status: 0 for a finished flight, otherwise 1.

    1 means a violation of d_min, a goal that was not reached, or a flight that failed.
    """
    failed = summary["d_min_violations"] or summary["converged"] is False or summary["failure"]
    return 1 if failed else 0


def write(summary: dict[str, Value], path: Path) -> None:
    """Write ``summary`` as JSON, one key a line."""
    path.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")


def yaw_errors(position: Array, yaw: Array, target: Array) -> Array:
    """Return |yaw − bearing of the true target| (T, K), deg; NaN where there is no target."""
    offset = target[:, None, :] - position
    error = yaw - np.arctan2(offset[..., 1], offset[..., 0])
    result: Array = np.degrees(np.abs((error + np.pi) % (2.0 * np.pi) - np.pi))
    return result


def standoff_errors(flight: Outcome, position: Array, target: Array) -> Array:
    """Return the distance (T, K) from the surface around the true target, m; empty unless escorting."""
    count = flight.scenario.vehicles
    if flight.scenario.task != "escort":
        return np.empty((0, count))
    return standoff(flight.scenario, position[:, :count], target)


def _percentiles(values: Array, *which: int | str) -> dict[str, float | None]:
    finite = values[np.isfinite(values)]
    names = ["max" if w == "max" else f"p{w}" for w in which]
    if not len(finite):
        return dict.fromkeys(names)
    levels = [100.0 if w == "max" else float(w) for w in which]
    return {name: round(float(np.percentile(finite, q)), 4) for name, q in zip(names, levels, strict=True)}


def _largest(values: Array) -> float | None:
    finite = values[np.isfinite(values)]
    return round(float(finite.max()), 3) if len(finite) else None


def _finite(value: float) -> float | None:
    return round(value, 4) if np.isfinite(value) else None


def _ns_to_ms(readings: Sequence[Sequence[int]]) -> Array:
    return np.array([ns for per_vehicle in readings for ns in per_vehicle], dtype=float) * 1e-6
