"""Lattice of places at one height where vehicles can be side by side, and the free lines between them.

Its places are so far apart that two vehicles may stand on neighbours. In lanes that are hardly wider than a
vehicle it matters where they are: the lattice is shifted so that most of its places are free. All vehicles
that know the same obstacles have the same lattice.
"""

from __future__ import annotations

from collections import deque
from itertools import product
from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from companion.values.horizon import Array
from companion.ways.clearance import Clearance

_ENOUGH = 1.25
"""Multiple of a clearance from which on more room is no better."""
_MOST = 4_000
"""Largest number of places; the lattice is wider where there would be more."""
_STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))


class Lattice:
    """Places of ``clearance`` (m) in the grid of ``clear``, which has one layer.

    They are ``apart`` (m) from each other, rounded up to whole cells of the grid.
    """

    def __init__(self, clear: Clearance, clearance: float, apart: float) -> None:
        grid = clear.grid
        nx, ny, _ = grid.shape
        every = max(ceil(apart / grid.cell - 1e-9), ceil(sqrt(nx * ny / _MOST)))
        room = np.minimum(clear.cells.reshape(grid.shape)[:, :, 0], _ENOUGH * clearance)
        free = room >= clearance
        # Of two shifts with as many free places that with more room, to 1 mm, is better.
        _, _, i, j = max(
            (int(free[i::every, j::every].sum()), round(float(room[i::every, j::every].sum()), 3), -i, -j)
            for i, j in product(range(every), repeat=2)
        )
        rows = np.argwhere(free[-i::every, -j::every])
        x, y = (-i + every * rows[:, 0], -j + every * rows[:, 1])
        chosen = grid.places((x * ny + y) * grid.shape[2])
        self.apart = every * grid.cell
        """Distance (m) of neighbours."""
        self.places: Array = chosen
        """(n, 3), m."""
        known = {(east, north): node for node, (east, north) in enumerate(rows.tolist())}
        self.beside: list[list[int]] = []
        """Places next to each one, to which the line is free."""
        for node, (east, north) in enumerate(rows.tolist()):
            others = (known.get((east + dx, north + dy)) for dx, dy in _STEPS)
            self.beside.append(
                [
                    other
                    for other in others
                    if other is not None and clear.free(chosen[node], chosen[other], clearance)
                ]
            )
        self._lengths: dict[int, NDArray[np.int64]] = {}

    def nearest(self, place: Array, taken: set[int] | None = None) -> int:
        """Return the place nearest to ``place`` (3,), m, that is not ``taken``; −1 if there is none."""
        off = self.places[:, :2] - place[:2]
        square = (off * off).sum(axis=1)
        if taken:
            square[list(taken)] = np.inf
        if not len(square):
            return -1
        node = int(np.argmin(square))
        return node if np.isfinite(square[node]) else -1

    def lengths(self, goal: int) -> NDArray[np.int64]:
        """Return the number of steps (n,) from each place to ``goal``; n where no way leads there."""
        found = self._lengths.get(goal)
        if found is None:
            found = np.full(len(self.places), len(self.places), dtype=np.int64)
            found[goal] = 0
            queue = deque([goal])
            while queue:
                node = queue.popleft()
                for other in self.beside[node]:
                    if found[other] > found[node] + 1:
                        found[other] = found[node] + 1
                        queue.append(other)
            self._lengths[goal] = found
        return found
