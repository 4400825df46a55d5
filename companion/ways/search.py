"""Shortest way from cell to cell of a grid, searched in parts: A* with 26 neighbours.

A* (P. Hart, N. Nilsson, B. Raphael, 1968) takes the cell of the least g + h next: g is the length of the way
to it, h the length of the shortest way on from it in an empty grid, √3·a + √2·(b − a) + (c − b) for a goal
that is a ≤ b ≤ c cells away on the three axes. h is enlarged by 1/1000: among ways of about the same length
it follows one, instead of all, and the way found is at most 1/1000 longer than the shortest.

A cell may be followed by a neighbour at a distance L if both have a clearance of √(r² + L²/4) or more: then
all of the line between them has a clearance of r (``clearance.py``). Ties are broken by the number of the
cell, so that the result is the same everywhere. The search is an own one, because those of libraries cannot
be interrupted, and a plan is due every 20 ms: SciPy's Dijkstra takes 45 ms for 138 000 cells, and 350 ms to
make the graph. Tests compare the two.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from companion.values.compiled import FLOAT, INT, array, kernel, output, part, several
from companion.values.horizon import Array
from companion.ways.clearance import Clearance
from companion.ways.grid import Indices

_FORWARD = 1.001
_SEARCHING, _FOUND, _NONE = 0, 1, 2
_NODE = types.int32
_NOT_IN_HEAP, _CLOSED = -1, -2


class Search:
    """Search of a way of ``clearance`` (m) from the cell ``start`` to the cell ``goal``.

    ``layer``: the lowest layer of the grid that it uses.
    """

    def __init__(self, clear: Clearance, clearance: float, start: int, goal: int, layer: int = 0) -> None:
        self._clear, self._clearance, self._goal, self._layer = clear, clearance, goal, layer
        count = len(clear.grid)
        self._length, self._key = np.full(count, inf), np.full(count, inf)
        self._before = np.full(count, -1, dtype=np.int32)
        self._place = np.full(count, _NOT_IN_HEAP, dtype=np.int32)
        self._heap = np.empty(count, dtype=np.int32)
        self._length[start] = self._key[start] = 0.0
        self._heap[0], self._place[start] = start, 0
        self._size = np.ones(1, dtype=np.int64)
        self._state = _SEARCHING
        self.expanded = 0
        """Number of cells that were expanded so far."""

    @property
    def done(self) -> bool:
        """Whether the search has ended."""
        return self._state != _SEARCHING

    def go_on(self, cells: int) -> bool:
        """Expand at most so many ``cells``; return whether the search has ended."""
        if self._state == _SEARCHING:
            grid = self._clear.grid
            count, self._state = _expand(
                self._clear.cells,
                *grid.shape,
                grid.cell,
                self._clearance,
                self._goal,
                self._layer,
                cells,
                self._size,
                self._length,
                self._key,
                self._before,
                self._place,
                self._heap,
            )
            self.expanded += count
        return self.done

    @property
    def length(self) -> float:
        """Length (m) of the way that was found; ∞ without one."""
        return float(self._length[self._goal]) if self._state == _FOUND else inf

    def cells(self) -> Indices | None:
        """Return the cells of the way, the first and the last included; None if there is none."""
        if self._state != _FOUND:
            return None
        found, cell = [], self._goal
        while cell >= 0:
            found.append(cell)
            cell = int(self._before[cell])
        return np.array(found[::-1])


@part
def _lower(heap: NDArray[np.int32], place: NDArray[np.int32], key: Array, index: int) -> None:
    """Move the cell at ``index`` of the heap towards its top, where it belongs."""
    cell = heap[index]
    while index > 0:
        above = (index - 1) // 2
        other = heap[above]
        if key[other] < key[cell] or (key[other] == key[cell] and other < cell):
            break
        heap[index] = other
        place[other] = index
        index = above
    heap[index] = cell
    place[cell] = index


@part
def _first(heap: NDArray[np.int32], place: NDArray[np.int32], key: Array, size: int) -> int:
    """Remove the first cell from the heap of ``size`` cells and return it."""
    first, cell = heap[0], heap[size - 1]
    size -= 1
    index = 0
    while 2 * index + 1 < size:
        below = 2 * index + 1
        one = heap[below]
        if below + 1 < size:
            other = heap[below + 1]
            if key[other] < key[one] or (key[other] == key[one] and other < one):
                below, one = below + 1, other
        if key[cell] < key[one] or (key[cell] == key[one] and cell < one):
            break
        heap[index] = one
        place[one] = index
        index = below
    if size > 0:
        heap[index] = cell
        place[cell] = index
    place[first] = _CLOSED
    return int(first)


@part
def _onward(x: int, y: int, z: int) -> float:
    """Return the length of the shortest way in an empty grid over so many cells on the three axes."""
    x, y, z = abs(x), abs(y), abs(z)
    least, most = min(x, min(y, z)), max(x, max(y, z))
    middle = x + y + z - least - most
    return sqrt(3.0) * least + sqrt(2.0) * (middle - least) + (most - middle)


@kernel(
    several(2, INT),
    array(1),
    INT,
    INT,
    INT,
    FLOAT,
    FLOAT,
    INT,
    INT,
    INT,
    output(1, INT),
    output(1),
    output(1),
    *[output(1, _NODE)] * 3,
)
def _expand(
    clear: Array,
    nx: int,
    ny: int,
    nz: int,
    edge: float,
    clearance: float,
    goal: int,
    layer: int,
    most: int,
    size: Indices,
    length: Array,
    key: Array,
    before: NDArray[np.int32],
    place: NDArray[np.int32],
    heap: NDArray[np.int32],
) -> tuple[int, int]:
    """Expand at most ``most`` cells; return how many, and the state of the search.

    ``clear`` (n,): clearances of the nx·ny·nz cells; none below ``layer`` is entered. ``size`` (1,): of
    the ``heap`` (n,). ``length``, ``key`` (n,): g and g + h of each cell; ``before`` (n,): the one before it;
    ``place`` (n,): its place in the heap.
    """
    gx, gy, gz = goal // (ny * nz), goal // nz % ny, goal % nz
    least = clearance * clearance if clearance > 0.0 else 0.0
    count = 0
    while size[0] > 0 and count < most:
        cell = _first(heap, place, key, size[0])
        size[0] -= 1
        count += 1
        if cell == goal:
            return count, _FOUND
        x, y, z = cell // (ny * nz), cell // nz % ny, cell % nz
        for i in range(max(x - 1, 0), min(x + 2, nx)):
            for j in range(max(y - 1, 0), min(y + 2, ny)):
                for k in range(max(z - 1, layer), min(z + 2, nz)):
                    other = (i * ny + j) * nz + k
                    if place[other] == _CLOSED:
                        continue
                    axes = abs(i - x) + abs(j - y) + abs(k - z)
                    worse = min(clear[cell], clear[other])
                    if worse < 0.0 or worse * worse < least + 0.25 * axes * edge * edge:
                        continue
                    new = length[cell] + sqrt(float(axes)) * edge
                    if new < length[other]:
                        length[other] = new
                        before[other] = cell
                        key[other] = new + _FORWARD * edge * _onward(i - gx, j - gy, k - gz)
                        if place[other] == _NOT_IN_HEAP:
                            heap[size[0]] = other
                            place[other] = size[0]
                            size[0] += 1
                        _lower(heap, place, key, place[other])
    return count, _SEARCHING if size[0] > 0 else _NONE
