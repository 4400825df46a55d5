"""Picture of each scenario: a column for each method, with the paths from above and the least separation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import numpy as np

from outrider.palette import LIMIT, OBSTACLE, TARGET, coloured, hex_of
from outrider.sweep.runs import Ending, Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_FAILURE_CHARACTERS = 44
"""Maximum number of characters of the failure text above a panel."""
_MAX_SEPARATION_M = 6.0
"""Upper limit of the separation axis (m)."""

Panel = tuple[str, Run, Mapping[str, Any] | None]
"""Method, result of the run, and the scene of the flight, or None without a flight."""


@coloured
def draw(scenario: str, panels: Sequence[Panel], path: Path) -> None:
    """Write the PNG of one scenario to ``path``."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.4 * len(panels), 5.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, len(panels), squeeze=False, height_ratios=(2.6, 1.0))
    for column, (way, run, scene) in enumerate(panels):
        axes[0, column].set_title(f"{way}\n{outcome(run)}", fontsize=9)
        if scene is not None and scene["time_s"]:
            _paths(axes[0, column], scene)
            _separation(axes[1, column], scene)
    axes[0, 0].set_ylabel("north, m")
    axes[1, 0].set_ylabel("least separation, m")
    figure.suptitle(f"{scenario}: paths from above (o start, ● end)", fontsize=11)
    figure.savefig(path, dpi=80, pil_kwargs={"optimize": True})


def outcome(run: Run) -> str:
    """Describe the result of a flight in a few words."""
    what = shorten(run.what or "", _MAX_FAILURE_CHARACTERS)
    if run.ending in (Ending.FAULT, Ending.LOST):
        return f"no flight: {what}"
    words = [what] if what else []
    if run.converged is not None:
        words.append(f"{run.seconds:.1f} s" if run.converged else "stuck")
    if run.separation is not None:
        words.append(f"least {run.separation:.2f} m")
    if run.violations:
        words.append(f"{run.violations} violation{'s' * (run.violations > 1)}{_elsewhere(run)}")
    return ", ".join(words) or "flown"


def _elsewhere(run: Run) -> str:
    """Return a remark if no pair of vehicles violated d_min, so that the violations concern others."""
    apart = run.separation is not None and run.d_min is not None and run.separation >= run.d_min
    return " (target or obstacle)" if apart else ""


def _paths(axes: Axes, scene: Mapping[str, Any]) -> None:
    from matplotlib.patches import Circle

    for east, north, radius in scene["obstacles"]:
        axes.add_patch(Circle((east, north), radius, color=OBSTACLE, lw=0.0))
    for way, radius in zip(scene["moving"], scene["moving_radius"], strict=True):
        axes.plot(*np.array(way).T, color=OBSTACLE, lw=0.8)
        axes.add_patch(Circle(way[-1], radius, fc="0.8", ec=OBSTACLE, lw=0.8))
    positions = np.array(scene["position"])
    for k in range(positions.shape[1]):
        of = hex_of(k) if k < scene["vehicles"] else OBSTACLE
        axes.plot(*positions[:, k].T, lw=0.9, color=of)
        axes.plot(*positions[0, k], "o", ms=3, mfc="none", color=of)
        axes.plot(*positions[-1, k], "o", ms=4, color=of)
    if scene["target"]:
        axes.plot(*np.array(scene["target"]).T, color=TARGET, lw=1.2, ls=":")
        axes.plot(*scene["target"][-1], "*", ms=9, color=TARGET)
    axes.set_aspect("equal", adjustable="datalim")
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)


def _separation(axes: Axes, scene: Mapping[str, Any]) -> None:
    near = np.array(scene["separation"])
    axes.plot(scene["time_s"], np.where(near < 0.0, np.nan, near), lw=1.0)
    axes.axhline(scene["d_min"], color=LIMIT, lw=1.0)
    axes.set_ylim(0.0, _MAX_SEPARATION_M)
    axes.set_xlabel("s", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)
