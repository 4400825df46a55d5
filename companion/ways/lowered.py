"""Clearances of the cells of a grid among balls that others cover, which change from search to search."""

from __future__ import annotations

import numpy as np

from companion.values.compiled import FLOAT, INT, VOID, array, kernel, output
from companion.values.horizon import Array
from companion.ways.balls import Balls
from companion.ways.grid import Grid


def lowered(cells: Array, grid: Grid, balls: Balls) -> Array:
    """Return the clearances ``cells`` (n,), m, of a ``grid``, with the ``balls`` as obstacles, too."""
    found = cells.copy()
    most = float(cells.max(initial=0.0))
    centres, radii, flat = (np.ascontiguousarray(part, dtype=np.float64) for part in balls)
    _lower(found, grid.first, *grid.shape, grid.cell, centres, radii, flat, most)
    return found


@kernel(VOID, output(1), array(1), INT, INT, INT, FLOAT, array(2), array(1), array(1), FLOAT)
def _lower(
    cells: Array,
    first: Array,
    nx: int,
    ny: int,
    nz: int,
    edge: float,
    centres: Array,
    radii: Array,
    flat: Array,
    most: float,
) -> None:
    """Lower the clearances ``cells`` (nx·ny·nz,) to those of the balls where these are below ``most``, m."""
    shape = nx, ny, nz
    begin, end = np.zeros(3, np.int64), np.zeros(3, np.int64)
    for m in range(len(centres)):
        reach = max(most + radii[m], 0.0)
        for axis in range(3):
            wide = reach if axis < 2 else (reach / flat[m] if flat[m] > 0.0 else np.inf)
            low = (centres[m, axis] - wide - first[axis]) / edge
            high = (centres[m, axis] + wide - first[axis]) / edge
            begin[axis] = int(np.ceil(min(max(low, 0.0), float(shape[axis]))))
            end[axis] = int(np.floor(min(max(high, -1.0), shape[axis] - 1.0))) + 1
        for i in range(begin[0], end[0]):
            x = first[0] + i * edge - centres[m, 0]
            for j in range(begin[1], end[1]):
                y = first[1] + j * edge - centres[m, 1]
                for k in range(begin[2], end[2]):
                    z = (first[2] + k * edge - centres[m, 2]) * flat[m]
                    cell = (i * ny + j) * nz + k
                    cells[cell] = min(cells[cell], np.sqrt(x * x + y * y + z * z) - radii[m])
