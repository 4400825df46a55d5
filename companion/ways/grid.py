"""Grid of places in the box: a cubic lattice with a bounded number of cells.

The lattice is centred in the box, so that a mirrored world has the mirrored lattice. Its cells are as small
as asked for, and larger where the box would hold too many.
"""

from __future__ import annotations

from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.config.planning import LimitsConfig
from companion.values.horizon import Array

Indices = NDArray[np.int64]

_GROWTH = 1.05
"""Factor by which cells grow until there are few enough."""


class Grid(NamedTuple):
    """Lattice of ``shape`` (3,) cells of edge ``cell`` (m); the first has its centre at ``first`` (3,), m."""

    first: Array
    shape: tuple[int, int, int]
    cell: float

    def __len__(self) -> int:
        return self.shape[0] * self.shape[1] * self.shape[2]

    def places(self, cells: Indices) -> Array:
        """Return the centres (…, 3), m, of ``cells`` (…), counted with the last axis first."""
        found: Array = self.first + self.cell * np.stack(np.unravel_index(cells, self.shape), axis=-1)
        return found

    def nearest(self, points: Array) -> Indices:
        """Return the cells (…) whose centres are nearest to the ``points`` (…, 3), m."""
        steps = np.rint((points - self.first) / self.cell).astype(np.int64)
        steps = np.minimum(np.maximum(steps, 0), np.array(self.shape) - 1)
        found: Indices = (steps[..., 0] * self.shape[1] + steps[..., 1]) * self.shape[2] + steps[..., 2]
        return found


def grid(limits: LimitsConfig, cell: float, most: int, level: float | None = None) -> Grid:
    """Return the grid of the box of ``limits`` with cells of ``cell`` (m) or more, at most ``most``.

    With a ``level`` (m) it has one layer, at this height.
    """
    low, high = np.array(limits.box_min), np.array(limits.box_max)
    if level is not None:
        low[2] = high[2] = level
    while True:
        count = np.floor((high - low) / cell + 1e-9).astype(np.int64) + 1
        if int(count.prod()) <= most:
            break
        cell *= _GROWTH
    x, y, z = count.tolist()
    first = 0.5 * (low + high - cell * (count - 1))
    first.flags.writeable = False
    return Grid(first, (x, y, z), cell)


def lowest(places: Grid, floor: float) -> int:
    """Return the lowest layer of a grid whose places are at the height ``floor`` (m) or above.

    That is the highest one if none is, and the only one of a plane.
    """
    steps = (floor - float(places.first[2])) / places.cell
    return min(max(ceil(steps - 1e-9), 0), places.shape[2] - 1) if steps > 0.0 else 0
