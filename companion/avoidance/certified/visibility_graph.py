"""Shortest way in the plane around discs and rounded rectangles, by a visibility graph.

The corners of the graph are those of a regular polygon around each disc, and around each corner of a
rectangle; two of them are connected if the straight line between them meets nothing. The search is A*
(P. Hart, N. Nilsson, B. Raphael, 1968), and works out the lines of a corner only when it gets there.
"""

from __future__ import annotations

from collections.abc import Generator
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.values.boxes import Boxes
from companion.values.horizon import Array

_CORNERS = 12
_INSIDE = 0.98
"""Share of its distance from the start or the goal to which a disc that holds it is reduced."""
_ROUNDING = 1e-9
"""m."""


class Rectangles(NamedTuple):
    """Rectangles seen from above, enlarged on all sides: places within ``radii`` (R,), m, of the sides.

    ``centres`` (R, 2), half of the sizes ``halves`` (R, 2), m, and cos and sin ``turns`` (R, 2) of the angle
    of the first side from east, counter-clockwise.
    """

    centres: Array
    halves: Array
    turns: Array
    radii: Array

    def local(self, points: Array) -> Array:
        """Return ``points`` (k, 2) in the frame of each rectangle, (k, R, 2)."""
        x, y = np.moveaxis(points[:, None] - self.centres, -1, 0)
        cos, sin = self.turns.T
        return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)

    def distance(self, points: Array) -> Array:
        """Return the distances (k, R), m, of ``points`` (k, 2) from the sides; 0 inside."""
        return _norm(np.maximum(np.abs(self.local(points)) - self.halves, 0.0))

    def corners(self) -> Array:
        """Return the corners of the sides, (R, 4, 2), m."""
        x, y = np.moveaxis(self.halves[:, None] * _SIGNS, -1, 0)
        cos, sin = self.turns.T[..., None]
        result: Array = self.centres[:, None] + np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
        return result


def rectangles(boxes: Boxes, radii: Array | None = None) -> Rectangles:
    """Return ``boxes`` as seen from above, enlarged by ``radii`` (R,), m; None: not enlarged."""
    radii = np.zeros(len(boxes.turns)) if radii is None else radii
    return Rectangles(boxes.centres[:, :2], boxes.halves[:, :2], boxes.turns, radii)


_SIGNS = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
_NO_RECTANGLES = Rectangles(np.empty((0, 2)), np.empty((0, 2)), np.empty((0, 2)), np.empty(0))


class Discs(NamedTuple):
    """Discs seen from above: centres (M, 2) and radii (M,), m; and ``rectangles``."""

    centres: Array
    radii: Array
    rectangles: Rectangles = _NO_RECTANGLES


def finding(
    start: Array, goal: Array, discs: Discs, low: Array, high: Array
) -> Generator[None, None, Array | None]:
    """Return the corners (k, 2) of the shortest way from ``start`` (2,) to ``goal`` (2,), the last; m.

    The corners are within ``low`` and ``high`` (2,). A disc that holds the start or the goal is reduced until
    it does not. None: there is no way. It yields after each corner whose lines it worked out.
    """
    discs = without(start, without(goal, discs))
    nodes = np.vstack([start, goal, _corners(discs, low, high)])
    lengths, before = np.full(len(nodes), np.inf), np.full(len(nodes), -1)
    lengths[0] = 0.0
    done = np.zeros(len(nodes), dtype=bool)
    rest = _norm(nodes - goal)
    queue = [(float(rest[0]), 0)]
    while queue:
        node = heappop(queue)[1]
        if node == 1:
            return _trace(nodes, before)
        if done[node]:
            continue
        done[node] = True
        open_ = np.flatnonzero(~done)
        seen = open_[free(nodes[node], nodes[open_], discs)]
        length = lengths[node] + _norm(nodes[seen] - nodes[node])
        for one, new in zip(seen.tolist(), length.tolist(), strict=True):
            if new < lengths[one]:
                lengths[one], before[one] = new, node
                heappush(queue, (new + float(rest[one]), one))
        yield
    return None


def free(point: Array, ends: Array, discs: Discs) -> NDArray[np.bool_]:
    """Return whether the lines from ``point`` (2,) to the ``ends`` (k, 2) meet no disc, (k,)."""
    line = ends - point
    square = np.maximum((line * line).sum(axis=1), _ROUNDING**2)
    centre = discs.centres - point
    share = np.clip(line @ centre.T / square[:, None], 0.0, 1.0)
    off = _norm(share[..., None] * line[:, None] - centre)
    result: NDArray[np.bool_] = np.all(off >= discs.radii - _ROUNDING, axis=1)
    if len(discs.rectangles.radii):
        result &= _beside(point, ends, discs.rectangles)
    return result


def _beside(point: Array, ends: Array, rectangles: Rectangles) -> NDArray[np.bool_]:
    """Return whether the lines from ``point`` (2,) to the ``ends`` (k, 2) meet no rectangle, (k,)."""
    start, to = rectangles.local(point[None]), rectangles.local(ends)
    line, halves = to - start, rectangles.halves
    # A line meets a rectangle itself if it is at one time within both pairs of sides.
    with np.errstate(over="ignore"):
        slope = np.where(line == 0.0, np.finfo(np.float64).tiny, line)
        times = np.stack([(-halves - start) / slope, (halves - start) / slope])
    enters, leaves = times.min(axis=0).max(axis=-1), times.max(axis=0).min(axis=-1)
    through = np.maximum(enters, 0.0) <= np.minimum(leaves, 1.0)
    # Otherwise the nearest points are an end and the rectangle, or one of its corners and the line.
    off = np.minimum(rectangles.distance(point[None]), rectangles.distance(ends))
    corners = halves[:, None] * _SIGNS
    square = np.maximum((line * line).sum(axis=-1), _ROUNDING**2)
    beyond = corners - start[:, :, None]
    share = np.clip((beyond * line[:, :, None]).sum(axis=-1) / square[..., None], 0.0, 1.0)
    off = np.minimum(off, _norm(share[..., None] * line[:, :, None] - beyond).min(axis=-1))
    result: NDArray[np.bool_] = np.all(~through & (off >= rectangles.radii - _ROUNDING), axis=1)
    return result


def without(point: Array, discs: Discs) -> Discs:
    """Return the ``discs``, reduced where they hold ``point`` (2,)."""
    discs = discs._replace(radii=np.minimum(discs.radii, _INSIDE * _norm(discs.centres - point)))
    flat = discs.rectangles
    if not len(flat.radii):
        return discs
    radii = np.minimum(flat.radii, _INSIDE * flat.distance(point[None])[0])
    return discs._replace(rectangles=flat._replace(radii=radii))


def _corners(discs: Discs, low: Array, high: Array) -> Array:
    """Return the corners (k, 2) of polygons around the discs that are in no disc."""
    angles = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=1) / np.cos(np.pi / _CORNERS)
    corners: Array = (discs.centres[:, None] + discs.radii[:, None, None] * unit).reshape(-1, 2)
    flat = discs.rectangles
    if len(flat.radii):
        around = flat.corners()[:, :, None] + flat.radii[:, None, None, None] * unit
        corners = np.vstack([corners, around.reshape(-1, 2)])
    outside = (_norm(corners[:, None] - discs.centres) >= discs.radii - _ROUNDING).all(axis=1)
    if len(flat.radii):
        outside &= (flat.distance(corners) >= flat.radii - _ROUNDING).all(axis=1)
    result: Array = corners[outside & ((corners >= low) & (corners <= high)).all(axis=1)]
    return result


def _trace(nodes: Array, before: NDArray[np.int64]) -> Array:
    """Return the nodes from the start, without it, to the goal."""
    found, node = [], 1
    while node != 0:
        found.append(node)
        node = int(before[node])
    result: Array = nodes[found[::-1]]
    return result


def _norm(vectors: Array) -> Array:
    result: Array = np.sqrt((vectors * vectors).sum(axis=-1))
    return result
