"""Finding a way from place to place: over the grid, then shortened; in parts, with less and less room."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from companion.values.horizon import Array
from companion.ways.clearance import Clearance
from companion.ways.corners import shortened
from companion.ways.grid import lowest
from companion.ways.search import Search

_CELLS = 250
"""Cells that are expanded as one part of the work, in about the time in which two lines are checked."""
_TRIED = 40
"""Cells near an end that are tried, at most, to connect it to the grid."""


class Found(NamedTuple):
    """Way over ``corners`` (k, 3), m, from its beginning to its end; ``level``: index of its clearance."""

    corners: Array
    level: int


def finding(
    clear: Clearance, clearances: Sequence[float], place: Array, goal: Array, floor: float = -inf
) -> Generator[None, None, Found | None]:
    """Return the way from ``place`` to ``goal`` (3,), m, of the first of ``clearances`` (m) with one.

    It keeps at the height ``floor`` (m) or above, except where an end is lower. None: there is no way. It
    yields after each part of the work.
    """
    layer = lowest(clear.grid, floor)
    for level, clearance in enumerate(clearances):
        start = yield from _cell(clear, clearance, place, layer)
        last = yield from _cell(clear, clearance, goal, layer)
        if start is None or last is None:
            continue
        search = Search(clear, clearance, start, last, layer)
        while not search.go_on(_CELLS):
            yield
        cells = search.cells()
        if cells is not None:
            chain = np.vstack([place, clear.grid.places(cells), goal])
            return Found((yield from shortened(clear, chain, clearance)), level)
    return None


def _cell(clear: Clearance, clearance: float, end: Array, layer: int) -> Generator[None, None, int | None]:
    """Return the nearest cell of ``clearance`` (m) to which the line from ``end`` (3,), m, is free; or None.

    It is in the ``layer`` of the grid or above.

    Near an end that is nearer to an obstacle less is enough (``Clearance.sees``).
    """
    grid = clear.grid
    missing = max(clearance - float(clear.at(end[None])[0]), 0.0)
    reach = 2.0 * (missing + grid.cell)
    steps = np.stack(np.unravel_index(grid.nearest(end), grid.shape))
    beyond = int(np.ceil(reach / grid.cell))
    low, high = np.maximum(steps - beyond, (0, 0, layer)), np.minimum(steps + beyond + 1, grid.shape)
    high[2] = max(high[2], layer + 1)
    x, y, z = (np.arange(a, b) for a, b in zip(low.tolist(), high.tolist(), strict=True))
    cells = ((x[:, None, None] * grid.shape[1] + y[:, None]) * grid.shape[2] + z).reshape(-1)
    # A cell of less clearance than this has no edge.
    cells = cells[clear.cells[cells] ** 2 >= clearance**2 + 0.25 * grid.cell**2]
    off = grid.places(cells) - end
    for index in np.argsort((off * off).sum(axis=1), kind="stable")[:_TRIED].tolist():
        yield
        if clear.sees(end, grid.places(cells[index]), clearance):
            return int(cells[index])
    return None
