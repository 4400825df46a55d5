"""Legends of matplotlib figures: outside of the axes, so that they cover no data."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIZE = 8


def beside(axes: Axes) -> None:
    """Add a legend to the right of ``axes``, if it has something to name."""
    if axes.get_legend_handles_labels()[1]:
        axes.legend(
            loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, fontsize=_SIZE, frameon=False
        )


def below(axes: Axes, columns: int) -> None:
    """Add a legend of ``columns`` below ``axes`` and its numbers, if it has something to name."""
    if axes.get_legend_handles_labels()[1]:
        axes.legend(
            loc="upper center", bbox_to_anchor=(0.5, -0.09), fontsize=_SIZE, frameon=False, ncols=columns
        )
