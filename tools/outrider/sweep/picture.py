"""Picture of a sweep: times to converge and least separations of each cell.

They are drawn as cumulative curves and as spreads, with d_min and the vehicles' span for comparison.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from outrider import legend
from outrider.palette import LIMIT, coloured
from outrider.sweep.report import CellReport
from outrider.sweep.runs import Ending, Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_CURVES = 10
"""Number of cells with a colour and a curve of their own; every cell has a row."""
Reading = Callable[[Run], float | None]


@coloured
def draw(name: str, cells: Sequence[CellReport], runs: Mapping[str, Sequence[Run]], path: Path) -> None:
    """Write the PNG; ``runs`` holds the runs of each cell by its key."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = len(cells)
    figure = Figure(figsize=(13, 5.0 + max(1.6, 0.42 * rows)), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, height_ratios=(4.0, max(1.6, 0.42 * rows)))
    curves = [figure.add_subplot(grid[0, column]) for column in range(2)]
    spreads = [figure.add_subplot(grid[1, column], sharex=curves[column]) for column in range(2)]
    of = [runs[cell.key] for cell in cells]
    times, separations = (lambda run: run.seconds), (lambda run: run.separation)
    _cumulative(curves[0], cells, of, times)
    _cumulative(curves[1], cells, of, separations)
    _spreads(spreads[0], cells, of, times)
    _spreads(spreads[1], cells, of, separations)
    curves[0].set(title="time to converge", ylabel="share of runs")
    curves[1].set(title="least separation of a run", ylabel="share of runs")
    spreads[0].set(xlabel="s after the goal event")
    spreads[1].set(xlabel="m between centres")
    spreads[1].tick_params(labelleft=False)
    for axes in (curves[1], spreads[1]):
        _limits(axes, cells)
    for axes in curves:
        axes.margins(x=0.08)
        axes.set_xlim(left=0.0)
    for axes in (*curves, *spreads):
        axes.grid(alpha=0.3)
    for axes in curves:
        legend.beside(axes)
    figure.suptitle(_headline(name, cells))
    figure.savefig(path, dpi=110)


def _headline(name: str, cells: Sequence[CellReport]) -> str:
    words = [f"sweep {name}", f"{sum(cell.ended for cell in cells)} runs"]
    words.append(f"{sum(cell.violations for cell in cells)} with a violation")
    words.append(f"{sum(cell.stuck + cell.failed for cell in cells)} did not arrive")
    lost = sum(cell.lost + cell.faults for cell in cells)
    return " · ".join(words + ([f"{lost} lost or at fault"] if lost else []))


def _cumulative(
    axes: Axes, cells: Sequence[CellReport], runs: Sequence[Sequence[Run]], reading: Reading
) -> None:
    """Draw the share of runs at or below each value. Runs that never converged keep the curve below 1."""
    all_values = [v for some in runs for run in some if (v := reading(run)) is not None]
    longest = max((v for v in all_values if isfinite(v)), default=0.0)
    for index, cell in enumerate(cells[:MOST_CURVES]):
        values = np.sort([v for run in runs[index] if (v := reading(run)) is not None])
        if not len(values):
            continue
        there = values[np.isfinite(values)]
        share = np.arange(1, len(there) + 1) / len(values)
        # Drawn to the right edge, so that a curve that ends below 1 is recognisable.
        x, y = [0.0, *there, longest], [0.0, *share, len(there) / len(values)]
        axes.step(x, y, where="post", lw=1.4, color=f"C{index}", label=cell.label)
    axes.set_ylim(0.0, 1.02)


def _spreads(
    axes: Axes, cells: Sequence[CellReport], runs: Sequence[Sequence[Run]], reading: Reading
) -> None:
    """Draw a row for each cell.

    Every run is a dot, 5 to 95 % are a thin bar, the quartiles a thick one, with the median; runs with a
    violation are highlighted.
    """
    # The height of the dots only separates them.
    scatter = np.random.default_rng(0)
    for index in range(len(cells)):
        color = f"C{index}" if index < MOST_CURVES else "0.4"
        readings = [(v, run) for run in runs[index] if (v := reading(run)) is not None]
        shown = [(v, run) for v, run in readings if isfinite(v)]
        if never := len(readings) - len(shown):
            beside = axes.get_yaxis_transform()
            axes.text(1.005, index, f"{never} never", va="center", fontsize=8, color=LIMIT, transform=beside)
        if not shown:
            continue
        values = np.array([value for value, _ in shown])
        bad = np.array([run.ending is Ending.VIOLATION for _, run in shown])
        height = index + scatter.uniform(-0.3, 0.3, size=len(values))
        axes.plot(values[~bad], height[~bad], ".", ms=3, alpha=0.35, color=color, mew=0)
        axes.plot(values[bad], height[bad], "x", ms=5, color=LIMIT)
        p5, p25, p50, p75, p95 = np.percentile(values, (5, 25, 50, 75, 95))
        axes.plot([p5, p95], [index, index], lw=1.0, color="0.15")
        axes.plot([p25, p75], [index, index], lw=4.0, color="0.15", solid_capstyle="butt")
        axes.plot([p50], [index], "o", ms=4, color="white", mec="0.15")
    axes.set_yticks(range(len(cells)), [cell.label for cell in cells], fontsize=8)
    axes.set_ylim(len(cells) - 0.5, -0.5)


def _limits(axes: Axes, cells: Sequence[CellReport]) -> None:
    for limit in sorted({cell.d_min for cell in cells if cell.d_min is not None}):
        axes.axvline(limit, color=LIMIT, lw=1.0, label=f"d_min {limit:g} m")
    for span in sorted({cell.span for cell in cells if cell.span is not None}):
        axes.axvline(span, color=LIMIT, lw=1.0, ls=":", label=f"tip to tip {span:.2f} m")
