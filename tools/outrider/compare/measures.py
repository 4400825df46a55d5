"""Figures of one flight in the terms of a comparison, from the simulated true motion.

Samples are 20 ms apart. Between them positions are cubic polynomials of the positions and velocities of the
samples, evaluated every 2.5 ms: two vehicles at 10 m/s each move 0.4 m between samples.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from outrider.compare.comparison import Measure
from outrider.runs.ground_truth import SAMPLE
from outrider.runs.outcome import Outcome

Array = NDArray[np.float64]
_BETWEEN = 8
"""Number of evaluations for each sample."""
_RESTS_M_S = 0.01
"""Speed below which a vehicle that has moved and not arrived stops."""


class Figures(NamedTuple):
    """Figures of one flight; times in s from the goal event, None for what did not occur or does not exist.

    ``arrived``: number of vehicles that reached their goals; ``mean_s`` and ``last_s`` of their arrivals, if
    all did. ``separation_m``: least distance of any two in the scene's measure. ``path_m``,
    ``acceleration2``, ``jerk2``, ``stops``: means over the vehicles until each has arrived.
    ``most_speed``, ``most_acceleration``, ``most_jerk``: largest of any axis.
    """

    vehicles: int
    arrived: int
    mean_s: float | None
    last_s: float | None
    separation_m: float
    path_m: float
    acceleration2: float
    jerk2: float | None
    stops: float
    most_speed: float
    most_acceleration: float
    most_jerk: float | None


def scaled(difference: Array, measure: Measure) -> Array:
    """Return the distances (…,), m, of ``difference`` (…, 3), m, in ``measure``."""
    if measure.kind == "box":
        return np.asarray(np.abs(difference).max(axis=-1))
    found: Array = np.linalg.norm(difference / (1.0, 1.0, measure.downwash), axis=-1)
    return found


def figures(outcome: Outcome, measure: Measure, goal_radius: float, *, has_jerk: bool) -> Figures:
    """Return the figures of a flight to goals.

    ``has_jerk``: whether the acceleration of a vehicle is continuous, so that its jerk exists.
    """
    count, goals = outcome.scenario.vehicles, outcome.starts.goals
    start = outcome.clock_start
    if start is None or goals is None:
        return Figures(count, 0, None, None, np.inf, 0.0, 0.0, None, 0.0, 0.0, 0.0, None)
    samples = outcome.truth.samples(start, outcome.clock_end)
    position, velocity = samples.position[:, :count], samples.velocity[:, :count]
    acceleration = samples.acceleration[:, :count]
    step = SAMPLE * 1e-6
    fine = between(position, velocity, step)
    near = np.linalg.norm(fine - goals, axis=-1) <= goal_radius
    arrived = near.any(axis=0)
    index = np.where(arrived, near.argmax(axis=0), len(fine) - 1)
    times = (float(samples.time[0] - start)) * 1e-6 + index * step / _BETWEEN
    flies = np.arange(len(position))[:, None] * _BETWEEN <= index
    legs = np.linalg.norm(np.diff(fine, axis=0), axis=-1)
    before = np.arange(len(legs))[:, None] < index
    jerk = np.diff(acceleration, axis=0) / step
    everyone = bool(arrived.all())
    return Figures(
        vehicles=count,
        arrived=int(arrived.sum()),
        mean_s=round(float(times.mean()), 4) if everyone else None,
        last_s=round(float(times.max()), 4) if everyone else None,
        separation_m=round(_least(fine, measure), 4),
        path_m=round(float((legs * before).sum(axis=0).mean()), 3),
        acceleration2=round(_integral(acceleration, flies, step), 3),
        jerk2=round(_integral(jerk, flies[1:], step), 2) if has_jerk else None,
        stops=round(float(_stops(velocity, flies).mean()), 3),
        most_speed=round(float(np.abs(velocity).max()), 3),
        most_acceleration=round(float(np.abs(acceleration).max()), 3),
        most_jerk=round(float(np.abs(jerk).max()), 2) if has_jerk and len(jerk) else None,
    )


def document(found: Figures) -> dict[str, Any]:
    """Return values of JSON; a distance is null if there was no pair."""
    values = found._asdict()
    values["separation_m"] = found.separation_m if np.isfinite(found.separation_m) else None
    return values


def between(position: Array, velocity: Array, step: float) -> Array:
    """Return positions (8 (T − 1) + 1, K, 3), m, from those of T samples ``step`` (s) apart.

    The cubic polynomial between two samples has their positions and velocities.
    """
    s = (np.arange(_BETWEEN) / _BETWEEN)[:, None, None, None]
    p, q, v, w = position[:-1], position[1:], step * velocity[:-1], step * velocity[1:]
    cubic = p + s * (v + s * (3.0 * (q - p) - 2.0 * v - w + s * (v + w - 2.0 * (q - p))))
    inner = cubic.swapaxes(0, 1).reshape(-1, *position.shape[1:])
    found: Array = np.concatenate([inner, position[-1:]])
    return found


def _least(fine: Array, measure: Measure) -> float:
    pairs = combinations(range(fine.shape[1]), 2)
    return min((float(scaled(fine[:, i] - fine[:, j], measure).min()) for i, j in pairs), default=np.inf)


def _integral(vectors: Array, flies: NDArray[np.bool_], step: float) -> float:
    """Return the mean over the vehicles of ∫ ‖vector‖² dt while they fly."""
    return float((np.square(vectors).sum(axis=-1) * flies).sum(axis=0).mean() * step)


def _stops(velocity: Array, flies: NDArray[np.bool_]) -> Array:
    """Return the number (K,) of times that each vehicle came to rest on its way."""
    rests = np.linalg.norm(velocity, axis=-1) < _RESTS_M_S
    moved = np.maximum.accumulate(~rests, axis=0)
    stopped = rests & moved & flies
    found: Array = (stopped[1:] & ~stopped[:-1]).sum(axis=0).astype(np.float64)
    return found
