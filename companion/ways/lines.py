"""Clearances along a line, from the clearances of a grid's cells: bounded, and interpolated.

Of a place that is e away from the centre of a cell of clearance c, the clearance is within c ± e. Between the
eight cells around it the clearance is interpolated linearly on each axis. The interpolated value is too large
by at most about h²/(4 r), for cells of edge h: the distance from a point is convex, and its second
derivatives are 1/r at most across the direction to it. It is too small where a place is about as near to two
obstacles.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from companion.values.compiled import BOOL, FLOAT, INT, array, kernel, output, part
from companion.values.horizon import Array
from companion.ways.grid import Indices

_LEFT, _GROWS = 0.9, 0.3
"""Near an end beside an obstacle this share of its clearance is enough, if that grew so much a metre."""
_ROUNDING = 1e-9


@part
def _between(clear: Array, shape: Indices, at: Array) -> float:
    """Return the interpolated clearance at the place ``at`` (3,), in cells from the first one.

    Beyond the grid it is that at its edge.
    """
    found = 0.0
    for corner in range(8):
        weight, index = 1.0, 0
        for axis in range(3):
            upper = (corner >> axis) & 1
            low = min(max(int(np.floor(at[axis])), 0), max(shape[axis] - 2, 0))
            share = min(max(at[axis] - low, 0.0), 1.0) if shape[axis] > 1 else 0.0
            weight *= share if upper else 1.0 - share
            index = index * shape[axis] + low + upper
        if weight > 0.0:
            found += weight * clear[index]
    return found


@part
def _from_nearest(shape: Indices, at: Array) -> tuple[int, float]:
    """Return the cell nearest to the place ``at`` (3,), and its distance, in cells."""
    index, square = 0, 0.0
    for axis in range(3):
        step = min(max(int(np.floor(at[axis] + 0.5)), 0), shape[axis] - 1)
        square += (at[axis] - step) ** 2
        index = index * shape[axis] + step
    return index, sqrt(square)


@kernel(
    INT,
    *[array(1)] * 2,
    array(1, INT),
    FLOAT,
    array(1),
    *[FLOAT] * 3,
    BOOL,
    output(1),
    output(1, BOOL),
)
def compare(
    first: Array,
    last: Array,
    shape: Indices,
    cell: float,
    clear: Array,
    clearance: float,
    begin: float,
    end: float,
    exact: bool,
    wanted: Array,
    doubtful: NDArray[np.bool_],
) -> int:
    """Compare the clearances between the places ``first`` and ``last`` (3,) with a ``clearance`` (m).

    The places are in cells of edge ``cell`` (m) from the first of the grid; the line is checked at n places.
    ``begin``, ``end``: clearances (m) at the two ends, near which less is enough. Returns −1 where a place is
    too near to an obstacle, otherwise how many are ``doubtful`` (n,). Unless ``exact`` these are only places
    nearer than a cell, because cells do not show a thin obstacle, and those near an end beside an obstacle.
    ``wanted`` (n,), m: clearances that are enough for the line to keep the ``clearance`` between the places,
    too.
    """
    count, at, left = len(wanted) - 1, np.empty(3), 0
    length = cell * sqrt((last[0] - first[0]) ** 2 + (last[1] - first[1]) ** 2 + (last[2] - first[2]) ** 2)
    for n in range(count + 1):
        share = n / count
        for axis in range(3):
            at[axis] = first[axis] + share * (last[axis] - first[axis])
        near = min(begin + _GROWS * share * length, end + _GROWS * (1.0 - share) * length)
        least = max(min(_LEFT * near, clearance), 0.0)
        wanted[n] = min(sqrt(least * least + 0.25 * (length / count) ** 2), max(near - _ROUNDING, 0.0))
        index, error = _from_nearest(shape, at)
        # Where the cell alone tells, nothing is interpolated.
        doubtful[n] = clear[index] - cell * error < wanted[n]
        if doubtful[n]:
            if clear[index] + cell * error < wanted[n]:
                return -1
            if not exact and wanted[n] >= cell:
                doubtful[n] = _between(clear, shape, at) < wanted[n]
                # In a corner of two obstacles the interpolated value is too small by up to half a cell.
                if doubtful[n] and least >= clearance:
                    return -1
            left += doubtful[n]
    return left
