"""Picture of a comparison: the paths of one flight of each row from above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from companion.config.obstacles import Obstacle, Post, Sphere, Wall
from outrider.palette import OBSTACLE, coloured, hex_of

if TYPE_CHECKING:
    from matplotlib.patches import Patch

_COLUMNS = 4


@coloured
def draw(
    title: str,
    traces: Mapping[str, list[Any]],
    path: Path,
    obstacles: Mapping[str, Sequence[Obstacle]] | None = None,
) -> None:
    """Write the PNG of ``traces``, positions (T, K, 3), m, by the label of the row, to ``path``.

    ``obstacles``, by the same labels, are drawn below the paths.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(_COLUMNS, len(traces))
    rows = ceil(len(traces) / columns)
    figure = Figure(figsize=(4.0 * columns, 4.2 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for one in axes[len(traces) :]:
        one.set_axis_off()
    for one, (label, trace) in zip(axes, traces.items(), strict=False):
        positions = np.array(trace)
        for obstacle in (obstacles or {}).get(label, ()):
            one.add_patch(_outline(obstacle))
        for k in range(positions.shape[1]):
            of = hex_of(k)
            one.plot(positions[:, k, 0], positions[:, k, 1], lw=1.0, color=of)
            one.plot(*positions[0, k, :2], "o", ms=4, mfc="none", color=of)
            one.plot(*positions[-1, k, :2], "o", ms=4, color=of)
        one.set(title=label, xlabel="east, m", ylabel="north, m")
        one.set_aspect("equal", adjustable="datalim")
        one.grid(alpha=0.3)
    figure.suptitle(title)
    figure.savefig(path, dpi=110)


def _outline(obstacle: Obstacle) -> Patch:
    """Return the outline of ``obstacle`` from above."""
    from matplotlib.patches import Circle, Rectangle

    if isinstance(obstacle, Post | Sphere):
        return Circle(obstacle.at[:2], obstacle.radius, color=OBSTACLE, lw=0.0)
    box = obstacle.box if isinstance(obstacle, Wall) else obstacle
    (x, y), (width, depth) = box.at[:2], box.size[:2]
    corner = x - 0.5 * width, y - 0.5 * depth
    return Rectangle(corner, width, depth, angle=box.yaw_deg, rotation_point="center", color=OBSTACLE, lw=0.0)
