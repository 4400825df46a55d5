"""Boxes with vertical sides: nearest points of their surfaces, signed distances, and which are near.

In the frame of a box, of its centre and axes, the nearest point of a point outside is that point clipped to
the box; inside, it lies on the nearest face. Boxes are sorted into tiles of neighbouring ones
(S. Leutenegger, M. Lopez, J. Edgington, "STR", 1997), so only the rectangles of the tiles and the boxes of
near tiles are looked at. The tiles are arrays, because the compiled kernels that search them cannot call the
tree of a library, which is an object of Python.
"""

from __future__ import annotations

from math import ceil, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.values.compiled import INT, VOID, array, kernel, output, part
from companion.values.horizon import Array

_INSIDE_M = 1e-3
"""Distance at which a box acts on a path that has entered it: below every least distance."""
_TILE = 16
"""Boxes of a tile."""


class Boxes(NamedTuple):
    """M boxes: ``centres`` (M, 3) and half of their sizes ``halves`` (M, 3), m; ``turns`` (M, 2).

    A turn is cos and sin of the angle from east to the box's own x axis, counter-clockwise.
    """

    centres: Array
    halves: Array
    turns: Array

    def chosen(self, rows: NDArray[np.int64]) -> Boxes:
        """Return the boxes of ``rows`` (K,)."""
        return Boxes(self.centres[rows], self.halves[rows], self.turns[rows])

    def rectangles(self) -> Array:
        """Return the least and largest x and y of each box, (M, 2, 2), m."""
        cos, sin = np.abs(self.turns).T
        x, y = self.halves[:, :2].T
        wide = np.stack([cos * x + sin * y, sin * x + cos * y], axis=1)
        result: Array = np.stack([self.centres[:, :2] - wide, self.centres[:, :2] + wide], axis=1)
        return result


def distances(points: Array, boxes: Boxes) -> Array:
    """Return the distances (…, M), m, of ``points`` (…, 3) from the surfaces; negative inside, NaN of NaN."""
    flat = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    found = np.empty((len(flat), len(boxes.centres)))
    _distances(flat, *boxes, found)
    return found.reshape(*points.shape[:-1], len(boxes.centres))


def beside(path: Array, boxes: Boxes) -> tuple[Array, Array]:
    """Return places (M, n, 3), m, from which the boxes push the points of a ``path`` (n, 3) away.

    A place is the nearest point of the surface. Once the path has entered a box, it lies 1 mm behind the
    path's own point, seen from the face through which it entered. So a path is pushed back out of a box, and
    not on where it has left it on the other side. A path that begins inside is pushed to the nearest face.
    Also returned are the least distances (M,), m, of the path from the boxes as seen from above; 0 for a box
    that it enters.
    """
    path = np.ascontiguousarray(path)
    places, least = np.empty((len(boxes.centres), *path.shape)), np.empty(len(boxes.centres))
    _beside(path, *boxes, places, least)
    return places, least


class BoxIndex:
    """Boxes in tiles; ``near`` gives those near a place, in the order in which they were given."""

    def __init__(self, boxes: Boxes) -> None:
        self.boxes = boxes
        self._rectangles = boxes.rectangles()
        order = _tiled(boxes.centres[:, :2])
        self._order = order
        count = ceil(len(order) / _TILE)
        parts = [self._rectangles[order[_TILE * k : _TILE * (k + 1)]] for k in range(count)]
        self._tiles: Array = np.array(
            [[part[:, 0].min(axis=0), part[:, 1].max(axis=0)] for part in parts]
        ).reshape(-1, 2, 2)

    def near(self, low: Array, high: Array) -> NDArray[np.int64]:
        """Return the rows (K,) of boxes whose rectangles reach that from ``low`` to ``high`` (2,), m."""
        found, count = np.empty(len(self._order), np.int64), np.zeros(1, np.int64)
        _near(low, high, self._tiles, self._rectangles, self._order, found, count)
        return np.sort(found[: count[0]])


def _tiled(places: Array) -> NDArray[np.int64]:
    """Return an order (M,) of ``places`` (M, 2) in which ``_TILE`` consecutive ones are neighbours."""
    by_x = np.argsort(places[:, 0], kind="stable")
    strip = _TILE * max(1, ceil(sqrt(len(places) / _TILE)))
    strips = [by_x[k : k + strip] for k in range(0, len(by_x), strip)]
    sorted_ = [part[np.argsort(places[part, 1], kind="stable")] for part in strips]
    return np.concatenate(sorted_).astype(np.int64) if sorted_ else np.empty(0, np.int64)


@kernel(VOID, array(1), array(1), array(3), array(3), array(1, INT), output(1, INT), output(1, INT))
def _near(
    low: Array,
    high: Array,
    tiles: Array,
    rectangles: Array,
    order: NDArray[np.int64],
    found: NDArray[np.int64],
    count: NDArray[np.int64],
) -> None:
    """Write the rows of the boxes that reach the rectangle to ``found`` and their ``count`` (1,)."""
    for tile in range(len(tiles)):
        apart = False
        for i in range(2):
            apart |= tiles[tile, 0, i] > high[i] or tiles[tile, 1, i] < low[i]
        if apart:
            continue
        for k in range(_TILE * tile, min(_TILE * (tile + 1), len(order))):
            row, apart = order[k], False
            for i in range(2):
                apart |= rectangles[row, 0, i] > high[i] or rectangles[row, 1, i] < low[i]
            if not apart:
                found[count[0]] = row
                count[0] += 1


@part
def _local(point: Array, centre: Array, turn: Array, own: Array) -> None:
    """Write ``point`` (3,) in the frame of a box to ``own`` (3,)."""
    x, y = point[0] - centre[0], point[1] - centre[1]
    own[0] = turn[0] * x + turn[1] * y
    own[1] = turn[0] * y - turn[1] * x
    own[2] = point[2] - centre[2]


@part
def _signed(own: Array, half: Array) -> float:
    """Return the distance of ``own`` (3,), in the frame of a box, from its surface; negative inside."""
    square, inside = 0.0, -np.inf
    for i in range(3):
        off = abs(own[i]) - half[i]
        inside = max(inside, off)
        square += max(off, 0.0) ** 2
    return inside if inside <= 0.0 else sqrt(square)


@kernel(VOID, array(2), array(2), array(2), array(2), output(2))
def _distances(points: Array, centres: Array, halves: Array, turns: Array, found: Array) -> None:
    own = np.empty(3)
    for n in range(len(points)):
        known = np.isfinite(points[n, 0] + points[n, 1] + points[n, 2])
        for m in range(len(centres)):
            _local(points[n], centres[m], turns[m], own)
            found[n, m] = _signed(own, halves[m]) if known else np.nan


@part
def _entered(before: Array, own: Array, half: Array) -> int:
    """Return the face through which the line from ``before`` (3,) to ``own`` (3,) enters; −1 without one.

    2i is the face in the direction of axis i, 2i + 1 the one opposite; ``before`` is outside.
    """
    first, last, face = -np.inf, 1.0, -1
    for i in range(3):
        step = own[i] - before[i]
        if step == 0.0:
            if abs(before[i]) > half[i]:
                return -1
            continue
        sign = -1.0 if step > 0.0 else 1.0
        enters, leaves = (sign * half[i] - before[i]) / step, (-sign * half[i] - before[i]) / step
        if enters > first:
            first, face = enters, 2 * i + (1 if sign < 0.0 else 0)
        last = min(last, leaves)
    return face if 0.0 <= first <= last else -1


@kernel(VOID, array(2), array(2), array(2), array(2), output(3), output(1))
def _beside(path: Array, centres: Array, halves: Array, turns: Array, places: Array, least: Array) -> None:
    """Write the results of ``beside``."""
    own, before, place = np.empty(3), np.empty(3), np.empty(3)
    for m in range(len(centres)):
        half, turn = halves[m], turns[m]
        face = -1
        least[m] = np.inf
        for n in range(len(path)):
            _local(path[n], centres[m], turn, own)
            distance = _signed(own, half)
            if n > 0 and face < 0:
                face = _entered(before, own, half)
            if face < 0 and distance <= 0.0:
                nearest = -np.inf
                for i in range(3):
                    if abs(own[i]) - half[i] > nearest:
                        nearest = abs(own[i]) - half[i]
                        face = 2 * i + (1 if own[i] < 0.0 else 0)
            for i in range(3):
                place[i] = own[i] if face >= 0 else min(max(own[i], -half[i]), half[i])
                before[i] = own[i]
            if face >= 0:
                place[face // 2] -= _INSIDE_M if face % 2 == 0 else -_INSIDE_M
                least[m] = 0.0
            x, y = max(abs(own[0]) - half[0], 0.0), max(abs(own[1]) - half[1], 0.0)
            least[m] = min(least[m], sqrt(x * x + y * y))
            places[m, n, 0] = centres[m, 0] + turn[0] * place[0] - turn[1] * place[1]
            places[m, n, 1] = centres[m, 1] + turn[1] * place[0] + turn[0] * place[1]
            places[m, n, 2] = centres[m, 2] + place[2]
