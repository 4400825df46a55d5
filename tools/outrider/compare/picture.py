"""Picture of a comparison: the paths of one flight of each row from above."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from outrider.palette import coloured, hex_of

_COLUMNS = 4


@coloured
def draw(title: str, traces: Mapping[str, list[Any]], path: Path) -> None:
    """Write the PNG of ``traces``, positions (T, K, 3), m, by the label of the row, to ``path``."""
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
