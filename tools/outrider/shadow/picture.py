"""Figure of a shadow run: set-points that would have been sent, those that were, and the flown path."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from outrider import legend
from outrider.palette import coloured
from outrider.shadow.setpoints import TOGETHER, Course, course
from outrider.shadow.shadow_run import ShadowRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WOULD, _SENT, _FLOWN = "C0", "C1", "0.55"


@coloured
def draw(name: str, found: ShadowRun, path: Path) -> None:
    """Write the PNG: paths from above, position and speed over time, in the vehicle's local NED."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    would, sent = course(found.would), course(found.sent)
    times = np.array([time for time, _ in found.places], dtype=np.int64)
    places = np.array([place for _, place in found.places]).reshape(-1, 3)
    start = min((int(t[0]) for t in (would.times, sent.times, times) if len(t)), default=0)
    figure = Figure(figsize=(13, 8), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(4, 2)
    above = figure.add_subplot(grid[:, 0])
    above.plot(places[:, 1], places[:, 0], color=_FLOWN, lw=1.4, label="flown")
    for of, colour, words in ((would, _WOULD, "would have been sent"), (sent, _SENT, "was sent")):
        if len(of.times):
            _, (north, east, _) = _broken(of, of.positions)
            above.plot(east, north, color=colour, lw=0.9, label=words)
    above.set(title="from above", xlabel="east, m", ylabel="north, m")
    above.set_aspect("equal", adjustable="datalim")
    legend.below(above, 3)
    first = None
    for row, (label, axis) in enumerate((("north, m", 0), ("east, m", 1), ("height, m", 2))):
        axes: Axes = figure.add_subplot(grid[row, 1], sharex=first)
        first = first or axes
        sign = -1.0 if axis == 2 else 1.0
        axes.plot((times - start) * 1e-6, sign * places[:, axis], color=_FLOWN, lw=1.4)
        _curve(axes, would, start, sign * would.positions[:, axis], _WOULD)
        _curve(axes, sent, start, sign * sent.positions[:, axis], _SENT)
        axes.set(ylabel=label)
    axes = figure.add_subplot(grid[3, 1], sharex=first)
    _curve(axes, would, start, np.linalg.norm(would.velocities, axis=1), _WOULD)
    _curve(axes, sent, start, np.linalg.norm(sent.velocities, axis=1), _SENT)
    axes.set(ylabel="speed, m/s", xlabel="s of the log")
    for axes in figure.axes:
        axes.grid(alpha=0.3)
    figure.suptitle(name)
    figure.savefig(path, dpi=110)


def _curve(axes: Axes, of: Course, start: int, values: np.ndarray, colour: str) -> None:
    """Plot ``values`` (n,) over the time since ``start`` (µs)."""
    if len(of.times):
        times, (line,) = _broken(of, values[:, None])
        axes.plot((times - start) * 1e-6, line, color=colour, lw=0.9)


def _broken(of: Course, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times (m,) and columns (c, m) of ``values`` (n, c), with a break in the line at every gap."""
    gaps = np.flatnonzero(np.diff(of.times) > TOGETHER) + 1
    times = np.insert(of.times.astype(np.float64), gaps, np.nan)
    return times, np.insert(values.astype(np.float64), gaps, np.nan, axis=0).T
