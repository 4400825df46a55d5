"""Figure of a run: paths from above, separation, stand-off and yaw errors, plan time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from outrider import legend
from outrider.palette import LIMIT, OBSTACLE, TARGET, coloured, hex_of
from outrider.runs.ground_truth import Samples
from outrider.runs.outcome import Outcome
from outrider.runs.summary import Value, standoff_errors, yaw_errors
from outrider.scenarios.footprints import beside, circles, rectangles
from outrider.scenarios.scenario import TARGET_SYSTEM

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_NAMED_VEHICLES = 24
"""Largest number of vehicles that are named; the names of more would cover the figure."""


@coloured
def draw(flight: Outcome, summary: dict[str, Value], path: Path) -> None:
    """Write the PNG of a finished flight to ``path``."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    samples = flight.truth.samples()
    figure = Figure(figsize=(14, 10.5), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(5, 2, width_ratios=(1.15, 1.0))
    _paths(figure.add_subplot(grid[:, 0]), flight, samples)
    time = (samples.time - (flight.clock_start or samples.time[0])) * 1e-6
    right = [figure.add_subplot(grid[row, 1]) for row in range(5)]
    for axes in right[1:4]:
        axes.sharex(right[0])
    _separation(right[0], flight, samples, time)
    _errors(right[1], right[2], flight, samples, time)
    _gradients(right[3], flight)
    _plan_time(right[4], flight)
    figure.suptitle(_headline(flight, summary))
    figure.savefig(path, dpi=110)


def _headline(flight: Outcome, summary: dict[str, Value]) -> str:
    certified = summary["avoidance"] == "certified"
    way = "certified" if certified else str(summary["method"])
    words = [flight.scenario.name, way, f"seed {flight.seed}"]
    if summary["motion"] == "point":
        words.append("points, no physics")
    if summary["converged"] is not None:
        seconds = summary["convergence_time_s"]
        words.append(f"converged in {seconds} s" if seconds is not None else "not converged")
    words.append(f"least separation {summary['min_separation_m']} m")
    words.append(f"{summary['d_min_violations']} violations")
    return " · ".join(words)


def _paths(axes: Axes, flight: Outcome, samples: Samples) -> None:
    """Draw all paths from above, with obstacles and the surface around the target's last position.

    Moving obstacles are drawn with their paths.
    """
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Circle

    few = len(flight.systems) <= _MAX_NAMED_VEHICLES
    for k, system in enumerate(flight.systems):
        name = f"{system}" if few else "_nolegend_"
        of = hex_of(k, flight.scenario.vehicles)
        axes.plot(samples.position[:, k, 0], samples.position[:, k, 1], lw=1.0, color=of, label=name)
        axes.plot(*samples.position[0, k, :2], "o", ms=4, mfc="none", color=of)
        axes.plot(*samples.position[-1, k, :2], "o", ms=5, color=of)
    for east, north, radius in circles(flight.scenario.obstacles):
        axes.add_patch(Circle((east, north), radius, color=OBSTACLE, lw=0.0))
    boxes = rectangles(flight.scenario.obstacles)
    axes.add_collection(PolyCollection(list(boxes), color=OBSTACLE, lw=0.0), autolim=False)
    if len(boxes):
        axes.update_datalim(beside(boxes, samples.position[..., :2].reshape(-1, 2)))
    for j, moving in enumerate(flight.scenario.moving):
        way = samples.moving[:, j, :2]
        axes.plot(way[:, 0], way[:, 1], color=OBSTACLE, lw=1.0)
        axes.add_patch(Circle(way[-1], moving.radius, fc="0.8", ec=OBSTACLE, lw=1.0))
    there = samples.target[np.isfinite(samples.target).all(axis=1)]
    if len(there):
        axes.plot(there[:, 0], there[:, 1], color=TARGET, lw=1.6, ls=":")
        name = "target" if flight.target_system == TARGET_SYSTEM else f"target {flight.target_system}"
        axes.plot(*there[-1, :2], "*", ms=12, color=TARGET, label=name)
        if flight.scenario.task == "escort":
            outline = there[-1] + flight.scenario.companion.surface.outline()
            axes.plot(outline[:, 0], outline[:, 1], color=TARGET, lw=0.8, ls="--")
    axes.set(title="paths from above (o start, ● end)", xlabel="east, m", ylabel="north, m")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)
    legend.below(axes, 8)


def _separation(axes: Axes, flight: Outcome, samples: Samples, time: np.ndarray) -> None:
    """Draw the least distance of any pair since the previous sample, with d_min and the vehicles' span."""
    separation = np.where(np.isfinite(samples.separation), samples.separation, np.nan)
    axes.plot(time, separation, lw=1.2, color="C0", label="vehicle to vehicle")
    offset = np.linalg.norm(samples.position - samples.target[:, None], axis=-1).min(axis=1)
    if flight.scenario.d_min_target is not None:
        axes.plot(time, offset, lw=1.0, color="C2", label="vehicle to target")
    axes.axhline(flight.scenario.d_min, color=LIMIT, lw=1.0, label=f"d_min {flight.scenario.d_min} m")
    axes.axhline(flight.span, color=LIMIT, lw=1.0, ls=":", label=f"tip to tip {flight.span} m")
    axes.set(title="least separation", ylabel="m")
    axes.set_ylim(0.0, None)
    _finish(axes, flight)


def _errors(standoff: Axes, yaw: Axes, flight: Outcome, samples: Samples, time: np.ndarray) -> None:
    """Draw the position error and the yaw error of each vehicle, from the clock's start to its end.

    The yaw error is the angle between a vehicle's heading and the direction to the target.
    """
    on_clock = (time >= 0.0) & (samples.time <= (flight.clock_end or samples.time[-1]))
    if flight.scenario.task == "escort":
        values = standoff_errors(flight, samples.position, samples.target)
        standoff.set(title="stand-off error")
    else:
        goals = flight.starts.goals
        positions = samples.position[:, : flight.scenario.vehicles]
        values = np.linalg.norm(positions - (0.0 if goals is None else goals), axis=-1)
        standoff.set(title="distance to the own goal")
    standoff.plot(time[on_clock], values[on_clock], lw=0.9)
    standoff.set(ylabel="m")
    _finish(standoff, flight)
    yaw.plot(time[on_clock], yaw_errors(samples.position, samples.yaw, samples.target)[on_clock], lw=0.9)
    yaw.set(
        title="yaw error", ylabel="deg", xlabel="s after the goal event" if flight.scenario.has_goal else "s"
    )
    _finish(yaw, flight)


def _gradients(axes: Axes, flight: Outcome) -> None:
    """Draw ‖∇J‖ / Ω_t of every plan: near 0 for a vehicle that has arrived (the paper, Sec. IV)."""
    for log in flight.plan_logs:
        time = (log.times - (flight.clock_start or 0)) * 1e-6
        axes.plot(time, np.linalg.norm(log.gradients, axis=1), lw=0.8)
    axes.set(title="‖∇J‖ / Ω_t", ylabel="m")
    axes.set_yscale("symlog", linthresh=0.1)
    _finish(axes, flight)


def _plan_time(axes: Axes, flight: Outcome) -> None:
    """Draw the histogram of the CPU time of all plans between the clock's start and its end."""
    tallies = flight.tallies
    values = np.array([n for before, after in tallies for n in after.plan_ns[len(before.plan_ns) :]]) * 1e-6
    if len(values):
        axes.hist(
            values,
            bins=np.linspace(0.0, max(1.0, float(np.percentile(values, 99.9))), 80).tolist(),
            color="C0",
        )
        for q in (50, 99):
            level = float(np.percentile(values, q))
            axes.axvline(level, color="0.2", lw=0.9, ls=":", label=f"p{q} {level:.2f} ms")
        legend.beside(axes)
    axes.set(title="CPU time of a plan", xlabel="ms", ylabel="plans")
    axes.grid(alpha=0.3)


def _finish(axes: Axes, flight: Outcome) -> None:
    axes.axvline(0.0, color="0.6", lw=0.8)
    if flight.clock_end is not None and flight.clock_start is not None:
        axes.axvline((flight.clock_end - flight.clock_start) * 1e-6, color="0.6", lw=0.8)
    axes.grid(alpha=0.3)
    legend.beside(axes)
