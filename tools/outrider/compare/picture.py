"""Picture of a comparison: the paths of one flight of each row from above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.config.obstacles import Obstacle, Post, Sphere, Wall
from outrider.palette import OBSTACLE, coloured, hex_of

if TYPE_CHECKING:
    from matplotlib.patches import Patch

Array = NDArray[np.float64]
_COLUMNS = 4
_LETTERS = 42
"""Letters of the title that are as wide as one panel."""


class Paths(NamedTuple):
    """What one panel shows: positions of K vehicles (T, K, 3), m, and below them the obstacles.

    Those that move have positions ``moving`` (T, M, 3), m, and ``radii`` (M,), m; a circle is drawn where
    each was at last.
    """

    vehicles: Array
    fixed: Sequence[Obstacle] = ()
    moving: Array = np.empty((0, 0, 3))
    radii: Sequence[float] = ()


@coloured
def draw(title: str, panels: Mapping[str, Paths], path: Path) -> None:
    """Write the PNG of ``panels``, by the labels of their rows, to ``path``."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    columns = min(_COLUMNS, len(panels))
    rows = ceil(len(panels) / columns)
    figure = Figure(figsize=(4.0 * columns, 4.2 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for one in axes[len(panels) :]:
        one.set_axis_off()
    for one, (label, paths) in zip(axes, panels.items(), strict=False):
        positions = paths.vehicles
        for obstacle in paths.fixed:
            one.add_patch(_outline(obstacle))
        for j, radius in enumerate(paths.radii):
            way = paths.moving[:, j]
            one.plot(way[:, 0], way[:, 1], lw=0.8, ls=":", color=OBSTACLE)
            one.add_patch(Circle((way[-1, 0], way[-1, 1]), radius, color=OBSTACLE, lw=0.0))
        for k in range(positions.shape[1]):
            of = hex_of(k)
            one.plot(positions[:, k, 0], positions[:, k, 1], lw=1.0, color=of)
            one.plot(*positions[0, k, :2], "o", ms=4, mfc="none", color=of)
            one.plot(*positions[-1, k, :2], "o", ms=4, color=of)
        one.set(title=label, xlabel="east, m", ylabel="north, m")
        one.set_aspect("equal", adjustable="datalim")
        one.grid(alpha=0.3)
    figure.suptitle(fill(title, _LETTERS * columns))
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
