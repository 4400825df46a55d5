"""Picture of each scenario: a column for each method, with paths, separation and stand-off error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from outrider.palette import LIMIT, OBSTACLE, TARGET, coloured, hex_of
from outrider.scenarios.footprints import beside
from outrider.sweep.runs import Ending, Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_FAILURE_CHARACTERS = 44
"""Maximum number of characters of the failure text above a panel."""
_SHARE_SHOWN = 95.0
"""Percentile of all values of a row that its axis holds at least: a few far larger ones are cut off."""


class Chart(NamedTuple):
    """Chart over time: its ``key`` in the scene, the ``name`` of its axis, what is said without a value."""

    key: str
    name: str
    nothing: str


_SEPARATION = Chart("separation", "least separation, m", "no two vehicles in the air")
_STANDOFF = Chart("standoff", "stand-off error, m", "no target")
Panel = tuple[str, Run, Mapping[str, Any] | None]
"""Method, result of the run, and the scene of the flight, or None without a flight."""


@coloured
def draw(scenario: str, panels: Sequence[Panel], path: Path) -> None:
    """Write the PNG of one scenario to ``path``."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    flown = [scene for _, _, scene in panels if scene is not None and scene["time_s"]]
    charts = [_SEPARATION, *([_STANDOFF] if any(scene.get("standoff") for scene in flown) else [])]
    figure = Figure(figsize=(3.4 * len(panels), 4.0 + 1.5 * len(charts)), layout="constrained")
    FigureCanvasAgg(figure)
    rows = 1 + len(charts)
    axes = figure.subplots(rows, len(panels), squeeze=False, height_ratios=(2.6, *[1.0] * len(charts)))
    for column, (way, run, scene) in enumerate(panels):
        axes[0, column].set_title(f"{way}\n{outcome(run)}", fontsize=9)
        if scene is None or not scene["time_s"]:
            for empty in axes[:, column]:
                empty.set_axis_off()
            axes[0, column].text(0.5, 0.5, "no flight", transform=axes[0, column].transAxes, ha="center")
            continue
        _paths(axes[0, column], scene)
        for row, chart in enumerate(charts, 1):
            _over_time(axes[row, column], scene, chart)
    _share(axes, panels, charts)
    figure.suptitle(f"{scenario}: paths from above (o start, ● end)", fontsize=11)
    figure.savefig(path, dpi=80, pil_kwargs={"optimize": True})


def _share(axes: NDArray[np.object_], panels: Sequence[Panel], charts: Sequence[Chart]) -> None:
    """Give all panels of a row the same axes, with names and numbers at the first of them."""
    shown = [k for k, panel in enumerate(panels) if panel[2] is not None and panel[2]["time_s"]]
    if not shown:
        return
    places = np.vstack([_corners(scene) for _, _, scene in panels if scene is not None and scene["time_s"]])
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    half = 0.54 * max(float(np.ptp(places, axis=0).max()), 1.0)
    last = max(panels[k][2]["time_s"][-1] for k in shown)  # type: ignore[index]
    for place, k in enumerate(shown):
        axes[0, k].set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))
        axes[-1, k].set_xlabel("s", fontsize=8)
        for row, chart in enumerate(charts, 1):
            axes[row, k].set(xlim=(0.0, max(last, 0.1)), ylim=(0.0, _top(panels, chart)))
            axes[row, k].tick_params(labelbottom=row == len(charts), labelleft=place == 0)
        axes[0, k].tick_params(labelleft=place == 0)
    for row, name in enumerate(("north, m", *(chart.name for chart in charts))):
        axes[row, shown[0]].set_ylabel(name, fontsize=8)


def _corners(scene: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the corners (n, 2), m, of what a panel shows from above."""
    paths = np.array(scene["position"], dtype=np.float64).reshape(-1, 2)
    found = [paths.min(axis=0), paths.max(axis=0)]
    found += [np.array(at, dtype=np.float64) for at in scene["target"]]
    for east, north, radius in scene["obstacles"]:
        found += [np.array([east - radius, north - radius]), np.array([east + radius, north + radius])]
    return np.vstack([np.array(found), beside(_boxes(scene), paths)])


def _boxes(scene: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the corners (M, 4, 2), m, of boxes and walls; journals of older versions have none."""
    return np.array(scene.get("boxes", ()), dtype=np.float64).reshape(-1, 4, 2)


def _top(panels: Sequence[Panel], chart: Chart) -> float:
    """Return the end of the axis of a chart, the same in all panels."""
    values = np.concatenate([_values(scene, chart).ravel() for _, _, scene in panels if scene is not None])
    values = values[np.isfinite(values)]
    limits = [float(scene["d_min"]) for _, _, scene in panels if scene is not None and chart is _SEPARATION]
    most = float(np.percentile(values, _SHARE_SHOWN)) if len(values) else 1.0
    return 1.1 * max(most, *limits, 0.1)


def _values(scene: Mapping[str, Any], chart: Chart) -> NDArray[np.float64]:
    """Return the values (T, n), m, of a chart; NaN where there is none."""
    values = np.array(scene.get(chart.key) or np.full(len(scene["time_s"]), -1.0), dtype=np.float64)
    values = values.reshape(len(scene["time_s"]), -1)
    return np.where(values < 0.0, np.nan, values)


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
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Circle

    for east, north, radius in scene["obstacles"]:
        axes.add_patch(Circle((east, north), radius, color=OBSTACLE, lw=0.0))
    axes.add_collection(PolyCollection(list(_boxes(scene)), color=OBSTACLE, lw=0.0))
    for way, radius in zip(scene["moving"], scene["moving_radius"], strict=True):
        axes.plot(*np.array(way).T, color=OBSTACLE, lw=0.8)
        axes.add_patch(Circle(way[-1], radius, fc="0.8", ec=OBSTACLE, lw=0.8))
    positions = np.array(scene["position"])
    for k in range(positions.shape[1]):
        of = hex_of(k, scene["vehicles"])
        axes.plot(*positions[:, k].T, lw=0.9, color=of)
        axes.plot(*positions[0, k], "o", ms=3, mfc="none", color=of)
        axes.plot(*positions[-1, k], "o", ms=4, color=of)
    if scene["target"]:
        axes.plot(*np.array(scene["target"]).T, color=TARGET, lw=1.2, ls=":")
        axes.plot(*scene["target"][-1], "*", ms=9, color=TARGET)
    axes.set_aspect("equal", adjustable="box")
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)


def _over_time(axes: Axes, scene: Mapping[str, Any], chart: Chart) -> None:
    """Draw a chart: the first of its values, and a band from there to the last."""
    values = _values(scene, chart)
    if np.isfinite(values).any():
        axes.plot(scene["time_s"], values[:, 0], lw=1.0, color="C0")
        if values.shape[1] > 1:
            axes.fill_between(scene["time_s"], values[:, 0], values[:, -1], color="C0", alpha=0.25, lw=0.0)
    else:
        axes.text(0.5, 0.5, chart.nothing, transform=axes.transAxes, ha="center", va="center", fontsize=8)
    if chart is _SEPARATION:
        axes.axhline(scene["d_min"], color=LIMIT, lw=1.0)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)
