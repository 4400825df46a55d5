"""Channels of numbers for plots: true motion, separation and plans; SI units, fleet-local ENU.

JSON has no NaN: missing values are omitted from the message.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from outrider.export.json_schema import enu, number, schema
from outrider.export.mcap_file import Entry, entry
from outrider.runs.arrays import Motion, Plans, Single
from outrider.runs.source import Run

MOTION: Final = schema(
    "outrider.Motion",
    "the true motion of a vehicle",
    position=enu("m"),
    velocity=enu("m/s"),
    reference=enu("m, reference position of its autopilot"),
    off_reference=number("m, distance of the true position from the reference"),
    yaw=number("rad counter-clockwise from east"),
    tilt=number("rad from upright"),
)
PLACE: Final = schema("outrider.Place", "true position of the target or a moving obstacle", position=enu("m"))
SEPARATION: Final = schema(
    "outrider.Separation",
    "least separation of vehicles",
    separation=number("m between centres, the least of any pair since the sample before"),
    d_min=number("m, limit of the separation"),
)
PLAN: Final = schema(
    "outrider.Plan",
    "a plan of a vehicle",
    gradient=enu("m, ∇J divided by Ω_t"),
    gradient_norm=number("m, near 0 when the vehicle has converged"),
)
PLAN_TIME: Final = schema("outrider.PlanTime", "computation time of a plan", plan_ms=number("ms of CPU time"))
_AXES = ("east", "north", "up")


def entries(run: Run) -> Iterator[Entry]:
    """Return the entries of all channels in order of time."""
    sources = []
    if run.motion is not None:
        d_min = None if run.scenario is None else run.scenario.d_min
        moving = () if run.scenario is None else tuple(run.scenario.moving_systems)
        sources.append(_motion(run.motion, d_min, moving))
        if run.gradients is not None:
            sources.append(_gradients(run.gradients))
        if run.plan_times is not None:
            sources.append(_plan_times(run.plan_times))
    return heapq.merge(*sources, key=lambda one: one.time)


def _motion(motion: Motion, d_min: float | None, moving: tuple[int, ...]) -> Iterator[Entry]:
    off = np.linalg.norm(motion.position - motion.reference, axis=-1)
    topics = [f"/vehicle/{system}/motion" for system in motion.system.tolist()]
    for row, time in enumerate(motion.time.tolist()):
        for k, topic in enumerate(topics):
            value: dict[str, Any] = {}
            for name, vector in (
                ("position", motion.position),
                ("velocity", motion.velocity),
                ("reference", motion.reference),
            ):
                if np.isfinite(vector[row, k]).all():
                    value[name] = _vector(vector[row, k])
            for name, scalar in (("off_reference", off), ("yaw", motion.yaw), ("tilt", motion.tilt)):
                if np.isfinite(scalar[row, k]):
                    value[name] = _short(scalar[row, k])
            yield entry(time, topic, MOTION, value)
        places = [("/target", motion.target[row])]
        places += [(f"/moving/{system}", motion.moving[row, k]) for k, system in enumerate(moving)]
        for topic, at in places:
            if np.isfinite(at).all():
                yield entry(time, topic, PLACE, {"position": _vector(at)})
        apart = {} if d_min is None else {"d_min": d_min}
        if np.isfinite(motion.separation[row]):
            apart["separation"] = _short(motion.separation[row])
        yield entry(time, "/separation", SEPARATION, apart)


def _gradients(plans: Plans) -> Iterator[Entry]:
    for time, system, gradient in _in_time(plans):
        if np.isfinite(gradient).all():
            value = {"gradient": _vector(gradient), "gradient_norm": float(np.linalg.norm(gradient))}
            yield entry(time, f"/vehicle/{system}/plan", PLAN, value)


def _plan_times(plans: Plans) -> Iterator[Entry]:
    for time, system, spent in _in_time(plans):
        if np.isfinite(spent):
            yield entry(time, f"/vehicle/{system}/plan_time", PLAN_TIME, {"plan_ms": float(spent)})


def _in_time(plans: Plans) -> Iterator[tuple[int, int, Any]]:
    for row in np.argsort(plans.time, kind="stable").tolist():
        yield int(plans.time[row]), int(plans.system[row]), plans.value[row]


def _vector(at: Single) -> dict[str, float]:
    return {axis: _short(part) for axis, part in zip(_AXES, at, strict=True)}


def _short(value: np.floating[Any]) -> float:
    """Return the number with the fewest digits that reads back as the same single-precision value.

    A double-precision value is returned unchanged.
    """
    return float(str(value))
