"""Data of the charts over time and of the histogram of planning times: numbers only."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from outrider.report import distances
from outrider.report.loss import Losses
from outrider.report.run import Array, Motions, Plans, PlanTimes, Run
from outrider.report.thinning import largest
from outrider.runs.formation_error import standoff
from outrider.runs.summary import yaw_errors
from outrider.scenarios.starts import starts

BINS = 80
CENTIMETRE = 1e-2
"""Step (m) of separations: they are shown with two decimals."""


class Level(NamedTuple):
    """Horizontal line at ``value``, in the chart's unit."""

    name: str
    value: float


class Line(NamedTuple):
    """Curve with ``values`` (n,) at the shown times; ``system`` is its vehicle, or None."""

    name: str
    system: int | None
    values: Array


class Chart(NamedTuple):
    """Chart.

    The scale is linear below ``bent`` and logarithmic above it; if ``bent`` is 0, all of it is linear.
    ``time`` (n,): times of the values (s), or None for the shown times. ``quantum``: step of the stored
    values, or None for one that is invisible in the picture.
    """

    key: str
    title: str
    unit: str
    note: str
    lines: tuple[Line, ...]
    levels: tuple[Level, ...] = ()
    bent: float = 0.0
    time: Array | None = None
    quantum: float | None = None


class Histogram(NamedTuple):
    """Histogram of the CPU times of plans.

    ``counts`` (BINS,) are in even bins from 0 to ``most`` ms; the last bin includes longer times. ``plans``
    is the number of plans; percentiles and the longest time are in ms.
    """

    counts: tuple[int, ...]
    most: float
    plans: int
    p50: float
    p99: float
    longest: float


def charts(
    run: Run, motions: Motions, shown: np.ndarray, losses: Losses, late: Mapping[int, float]
) -> list[Chart]:
    """Return all charts that have data, over the samples ``shown`` (n,).

    ``late`` (s), by system id: how much a vehicle's clock is ahead (``clocks.errors``); the times of its
    plans are on that clock.
    """
    found = [_separation(run, motions)]
    where = _where(run, motions)
    if where is not None:
        title, note, values = where
        found.append(Chart("place", title, "m", note, _lines(motions, values[shown])))
    if np.isfinite(motions.target).any():
        errors = yaw_errors(motions.position, motions.yaw, motions.target)
        note = "between the nose and the bearing of the true target"
        found.append(Chart("yaw", "Yaw error", "°", note, _lines(motions, errors[shown])))
    tracking = np.linalg.norm(motions.position - motions.reference, axis=-1)
    note = "between the true position and the autopilot's reference: sum of control and estimation errors"
    found.append(Chart("tracking", "Tracking error", "m", note, _lines(motions, tracking[shown])))
    if run.plans is not None and len(run.plans.time):
        found.append(_gradients(run.plans, motions, shown, late))
    speed = np.linalg.norm(motions.velocity, axis=-1)
    found.append(Chart("speed", "Speed", "m/s", "true, over ground", _lines(motions, speed[shown])))
    if len(losses.by_second):
        found.append(_loss(losses, motions.time[shown]))
    return [chart for chart in found if any(np.isfinite(line.values).any() for line in chart.lines)]


def histogram(times: PlanTimes | None) -> Histogram | None:
    """Return the histogram of all plans; None if there is none."""
    spent = np.empty(0) if times is None else times.spent[np.isfinite(times.spent)]
    if not len(spent):
        return None
    p50, p99, most = (float(np.percentile(spent, q)) for q in (50.0, 99.0, 99.9))
    most = max(most * 1.02, 1e-3)
    counts = np.histogram(np.minimum(spent, most), BINS, (0.0, most))[0]
    return Histogram(tuple(counts.tolist()), most, len(spent), p50, p99, float(spent.max()))


def _lines(motions: Motions, values: Array) -> tuple[Line, ...]:
    """Return one line for each vehicle; ``values`` (n, k), with the vehicles that fly the task first."""
    return tuple(
        Line(str(system), system, values[:, k]) for k, system in enumerate(motions.system[: values.shape[1]])
    )


def _separation(run: Run, motions: Motions) -> Chart:
    """Return the chart of all samples: at every time it has the value that the run's file has there."""
    scenario, levels = run.scenario, []
    d_min, span = run.summary.get("d_min_m"), run.summary.get("span_m")
    if scenario is not None:
        d_min = scenario.d_min
    for name, value in (("d_min", d_min), ("tip to tip", span)):
        if isinstance(value, int | float):
            levels.append(Level(name, float(value)))
    lines = [Line("vehicle to vehicle", None, _finite(motions.separation))]
    if scenario is not None and scenario.d_min_target is not None:
        target = np.fmin.reduce(distances.to_target(motions), axis=1)
        lines.append(Line("vehicle to target", None, _finite(target)))
    if scenario is not None and (scenario.obstacles or scenario.moving):
        surface = distances.to_obstacles(motions, scenario).min(axis=1)
        lines.append(Line("vehicle to an obstacle's surface", None, _finite(surface)))
    note = "between centres, on true positions at every physics step in the air"
    return Chart(
        "separation",
        "Least separation",
        "m",
        note,
        tuple(lines),
        tuple(levels),
        time=motions.time,
        quantum=CENTIMETRE,
    )


def _finite(values: Array) -> Array:
    result: Array = np.where(np.isfinite(values), values, np.nan)
    return result


def _where(run: Run, motions: Motions) -> tuple[str, str, Array] | None:
    """Return title, note and distances (T, k), m, of the vehicles that fly the task from goal or surface.

    The result is None if the scenario is not known or does not fit the motions.
    """
    scenario = run.scenario
    if scenario is None or len(motions.system) != scenario.size:
        return None
    position = motions.position[:, : scenario.vehicles]
    goals = starts(scenario, run.seed or 0, scenario.companion.planar).goals
    if goals is not None:
        return "Distance to the goal", "of each vehicle to its own", np.linalg.norm(position - goals, axis=-1)
    note = "distance from the destination surface around the true target"
    return "Stand-off error", note, standoff(scenario, position, motions.target)


def _gradients(plans: Plans, motions: Motions, shown: np.ndarray, late: Mapping[int, float]) -> Chart:
    lines = []
    for system in motions.system:
        own = plans.system == system
        if own.any():
            values = largest(plans.time[own] - late.get(system, 0.0), plans.size[own], motions.time[shown])
            lines.append(Line(str(system), system, values))
    note = "of every plan, divided by Ω_t; near 0 when a vehicle has converged"
    return Chart("gradient", "‖∇J‖", "m", note, tuple(lines), bent=0.1)


def _loss(losses: Losses, time: Array) -> Chart:
    place = np.floor(time).astype(int) - losses.since
    inside = (place >= 0) & (place < len(losses.by_second))
    values = np.full(len(time), np.nan)
    values[inside] = 100.0 * losses.by_second[place[inside]]
    note = "share of the messages sent in each second that did not arrive, over all pairs"
    return Chart("loss", "Message loss", "%", note, (Line("swarm link", None, values),))
