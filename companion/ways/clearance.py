"""Clearance: the distance of places from the nearest fixed obstacle, and whether lines keep a clearance.

Distances are signed and never change by more than the distance of two places (they are 1-Lipschitz). From
this follow three bounds, for obstacles of any shape:

- near a cell of clearance c the clearance at a place that is e away from its centre is within c ± e;
- between two places of clearance m or more that are s apart, the clearance r satisfies r² ≥ m² − s²/4,
  because each point of an obstacle is outside of the balls of radius m about both;
- a place of a block of cells is nearer than R only to obstacles within R plus half a diagonal of its centre.

The third bound makes the clearances of a large world: a block of cells is compared with all obstacles at
once, at its centre, and its cells only with those that are near.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import lru_cache
from math import inf, sqrt

import numpy as np

from companion.config.obstacles import Obstacle
from companion.config.planning import LimitsConfig
from companion.obstacles.static import FixedObstacles
from companion.values.horizon import Array
from companion.ways.balls import Balls
from companion.ways.grid import Grid, Indices, grid
from companion.ways.lines import compare
from companion.ways.lowered import lowered

_BLOCK = 8
"""Edge of a block in cells."""
_AT_ONCE = 200_000
"""Largest number of distances that are worked out at once."""
_ENOUGH, _ROUNDING = 1.12, 1e-6
"""Multiple of a clearance from which on the end of a line changes nothing, and rounding (m)."""
_SPACING_M = 0.2
"""Distance of the places at which a line is checked."""


class Clearance:
    """Clearances in a ``grid``: ``cells`` (n,), m, those of its cells. None is larger than ``most`` (m)."""

    def __init__(self, obstacles: Sequence[Obstacle], places: Grid, most: float) -> None:
        self.grid, self.most = places, most
        self._all = FixedObstacles(tuple(obstacles))
        self._shape = np.array(places.shape)
        self._blocks = -(-self._shape // _BLOCK)
        self._near = self._nearby(obstacles)
        self._low = places.first - 0.5 * places.cell
        self._high = self._low + places.cell * self._shape
        self.cells: Array = np.full(len(places), most)
        for block, near in enumerate(self._near):
            if near is not None:
                inside = self._inside(block)
                self.cells[inside] = self._least(near, places.places(inside))
        self.cells.flags.writeable = False
        self._balls: Balls | None = None

    def among(self, balls: Balls) -> Clearance:
        """Return these clearances with ``balls`` as obstacles, too."""
        found = copy(self)
        found._balls = balls
        found.cells = lowered(self.cells, self.grid, balls)
        found.cells.flags.writeable = False
        return found

    def at(self, points: Array) -> Array:
        """Return the clearances (n,), m, of ``points`` (n, 3), m, at most ``most``."""
        found = np.full(len(points), self.most)
        outside = ((points < self._low) | (points > self._high)).any(axis=1)
        blocks = np.where(outside, -1, self._block(points))
        for block in np.unique(blocks).tolist():
            near = self._all if block < 0 else self._near[block]
            if near is not None and len(near):
                here = blocks == block
                found[here] = self._least(near, points[here])
        return found if self._balls is None else np.minimum(found, self._balls.distance(points))

    def sees(self, start: Array, end: Array, clearance: float) -> bool:
        """Return whether about all between ``start`` and ``end`` (3,), m, keeps the ``clearance`` (m).

        Clearances of a cell's edge or more are interpolated. Near an end beside an obstacle less is enough.
        """
        begin, last = self._at_end(start, clearance), self._at_end(end, clearance)
        return self._check(start, end, clearance, begin, last, exact=False)

    def free(self, start: Array, end: Array, clearance: float) -> bool:
        """Return whether all places between ``start`` and ``end`` (3,), m, keep the ``clearance`` (m)."""
        return self._check(start, end, clearance, inf, inf, exact=True)

    def _at_end(self, end: Array, clearance: float) -> float:
        """Return the clearance (m) at the ``end`` (3,), m, of a line; ∞ where it is more than enough."""
        cell = self.grid.nearest(end)
        off = end - self.grid.places(cell)
        enough = self.cells[cell] - sqrt(off @ off) >= _ENOUGH * clearance
        return inf if enough else float(self.at(end[None])[0])

    def _check(
        self, start: Array, end: Array, clearance: float, begin: float, finish: float, *, exact: bool
    ) -> bool:
        line, grid = end - start, self.grid
        count = int(sqrt(line @ line) / _SPACING_M) + 1
        wanted, doubtful = np.empty(count + 1), np.empty(count + 1, dtype=np.bool_)
        first, last = (start - grid.first) / grid.cell, (end - grid.first) / grid.cell
        left = compare(
            first, last, self._shape, grid.cell, self.cells, clearance, begin, finish, exact, wanted, doubtful
        )
        if left <= 0:
            return left == 0
        points = start + np.flatnonzero(doubtful)[:, None] / count * line
        return bool((self.at(points) >= wanted[doubtful]).all())

    def _nearby(self, obstacles: Sequence[Obstacle]) -> list[FixedObstacles | None]:
        """Return for each block the obstacles that its cells and places may be near; None without any."""
        cell, count = self.grid.cell, int(self._blocks.prod())
        index = np.stack(np.unravel_index(np.arange(count), self._blocks), axis=-1)
        centres = self.grid.first + cell * (_BLOCK * index + 0.5 * (_BLOCK - 1))
        reach = self.most + 0.5 * sqrt(3.0) * _BLOCK * cell
        found: list[FixedObstacles | None] = []
        rows = max(1, _AT_ONCE // max(len(obstacles), 1))
        for begin in range(0, count, rows):
            for near in self._all.distance(centres[begin : begin + rows]) < reach:
                these = tuple(obstacles[j] for j in np.flatnonzero(near).tolist())
                found.append(FixedObstacles(these) if these else None)
        return found

    def _inside(self, block: int) -> Indices:
        """Return the cells of ``block``."""
        first = _BLOCK * np.stack(np.unravel_index(block, self._blocks))
        last = np.minimum(first + _BLOCK, self.grid.shape)
        x, y, z = (np.arange(a, b) for a, b in zip(first.tolist(), last.tolist(), strict=True))
        _, ny, nz = self.grid.shape
        found: Indices = ((x[:, None, None] * ny + y[:, None]) * nz + z).reshape(-1)
        return found

    def _block(self, points: Array) -> Indices:
        """Return the blocks (n,) that hold the cells nearest to ``points`` (n, 3), m."""
        x, y, z = np.unravel_index(self.grid.nearest(points), self.grid.shape)
        found: Indices = (x // _BLOCK * self._blocks[1] + y // _BLOCK) * self._blocks[2] + z // _BLOCK
        return found

    def _least(self, obstacles: FixedObstacles, points: Array) -> Array:
        """Return the clearances (n,), m, of ``points`` (n, 3), m, from ``obstacles``."""
        rows = max(1, _AT_ONCE // len(obstacles))
        parts = [
            obstacles.distance(points[begin : begin + rows]).min(axis=1)
            for begin in range(0, len(points), rows)
        ]
        found: Array = np.minimum(parts[0] if len(parts) == 1 else np.concatenate(parts), self.most)
        return found


@lru_cache(maxsize=8)
def clearance_of(
    obstacles: tuple[Obstacle, ...],
    limits: LimitsConfig,
    cell: float,
    most_cells: int,
    most: float,
    level: float | None = None,
) -> Clearance:
    """Return the clearance of ``obstacles`` in the box of ``limits``; companions of one process share it.

    ``cell`` (m), ``most_cells`` and ``level`` (m) as in ``grid``. Cells tell of all their places which have a
    clearance of ``most`` (m).
    """
    places = grid(limits, cell, most_cells, level)
    return Clearance(obstacles, places, _ENOUGH * most + sqrt(0.75) * places.cell + _ROUNDING)
