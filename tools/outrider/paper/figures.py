"""Figures as in the paper: trajectories and ‖∇J‖ of every row, and a comparison of the times to converge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from outrider import legend
from outrider.palette import OBSTACLE, TARGET, coloured, hex_of
from outrider.paper.results import Result
from outrider.paper.rows import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_METHODS = ("baseline", "swivel", "approach_angle", "tangential")


@coloured
def draw(
    rows: Sequence[Row], results: Sequence[Result], traces: Mapping[Row, Mapping[str, Any]], folder: Path
) -> list[Path]:
    """Write ``METHOD.png`` for each method and ``times.png``, and return their paths."""
    paths = []
    for method in _METHODS:
        of = [row for row in rows if row.method == method and row in traces]
        if of:
            paths.append(folder / f"{method}.png")
            _save(_flights(method, of, traces), paths[-1])
    paths.append(folder / "times.png")
    _save(_times(rows, results), paths[-1])
    return paths


def _flights(method: str, rows: Sequence[Row], traces: Mapping[Row, Mapping[str, Any]]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * len(rows), 7.5), layout="constrained")
    axes = figure.subplots(2, len(rows), squeeze=False)
    for column, row in enumerate(rows):
        _paths(axes[0, column], row, traces[row])
        _gradient(axes[1, column], traces[row])
    figure.suptitle(f"{method}, seed 1: paths from above, and ‖∇J‖ / Ω_t")
    return figure


def _paths(axes: Axes, row: Row, trace: Mapping[str, Any]) -> None:
    positions = np.array(trace["position"])
    flying = len(trace["gradient"][0]) if trace["gradient"] else 0
    for k in range(positions.shape[1]):
        bystander = k >= flying
        of = OBSTACLE if bystander else hex_of(k)
        axes.plot(positions[:, k, 0], positions[:, k, 1], lw=1.0, color=of)
        axes.plot(*positions[0, k, :2], "o", ms=4, mfc="none", color=of)
        axes.plot(*positions[-1, k, :2], "s" if bystander else "o", ms=5, color=of)
    if trace["target"] is not None and row.scenario.startswith("scenario"):
        axes.plot(*trace["target"][:2], "*", ms=11, color=TARGET)
    axes.set(title=row.scenario, xlabel="east, m", ylabel="north, m")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)


def _gradient(axes: Axes, trace: Mapping[str, Any]) -> None:
    axes.plot(trace["time_s"], trace["gradient"], lw=0.9)
    axes.set(xlabel="s after the goal event", ylabel="m")
    axes.set_yscale("symlog", linthresh=0.1)
    axes.grid(alpha=0.3)


def _times(rows: Sequence[Row], results: Sequence[Result]) -> Figure:
    """Draw median and longest times to converge beside the paper's; stuck rows are hatched to the top."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.5), layout="constrained")
    axes = figure.subplots()
    places = np.arange(len(rows))
    reported = [_number(row.reported) for row in rows]
    ours = [result.median_s for result in results]
    top = 1.1 * max([value for value in (*reported, *ours) if value is not None], default=1.0)
    axes.bar(places - 0.2, [value or 0.0 for value in reported], 0.38, color="0.75", label="paper")
    axes.bar(places + 0.2, [value or 0.0 for value in ours], 0.38, color="C0", label="here, median")
    for place, row, result in zip(places, rows, results, strict=True):
        if row.reported == "stuck":
            axes.bar(place - 0.2, top, 0.38, color="none", edgecolor="0.75", hatch="///")
        if result.median_s is None:
            axes.bar(place + 0.2, top, 0.38, color="none", edgecolor="C0", hatch="///")
        elif result.worst_s is not None:
            axes.plot([place + 0.2] * 2, [result.median_s, result.worst_s], color="0.2", lw=1.2)
    axes.set_xticks(places, [f"{row.scenario}\n{row.method}" for row in rows], fontsize=7, rotation=45)
    axes.set(ylabel="s to converge (hatched: stuck)", ylim=(0.0, top))
    axes.grid(axis="y", alpha=0.3)
    legend.beside(axes)
    return figure


def _number(text: str) -> float | None:
    """Return the number of seconds in the paper's text, or None."""
    digits = text.strip("≈ ")
    return float(digits) if digits.isdigit() else None


def _save(figure: Figure, path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=110)
