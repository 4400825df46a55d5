"""Shortest way in the plane around discs, by a visibility graph.

The corners of the graph are those of a regular polygon around each disc; two of them are connected if the
straight line between them meets no disc. The search is A* (P. Hart, N. Nilsson, B. Raphael, 1968), and works
out the lines of a corner only when it gets there.
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.values.horizon import Array

_CORNERS = 12
_INSIDE = 0.98
"""Share of its distance from the start or the goal to which a disc that holds it is reduced."""
_ROUNDING = 1e-9
"""m."""


class Discs(NamedTuple):
    """Discs seen from above: centres (M, 2) and radii (M,), m."""

    centres: Array
    radii: Array


def way(start: Array, goal: Array, discs: Discs, low: Array, high: Array) -> Array | None:
    """Return the corners (k, 2) of the shortest way from ``start`` (2,) to ``goal`` (2,), the last; m.

    The corners are within ``low`` and ``high`` (2,). A disc that holds the start or the goal is reduced until
    it does not. None: there is no way.
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
    return None


def free(point: Array, ends: Array, discs: Discs) -> NDArray[np.bool_]:
    """Return whether the lines from ``point`` (2,) to the ``ends`` (k, 2) meet no disc, (k,)."""
    line = ends - point
    square = np.maximum((line * line).sum(axis=1), _ROUNDING**2)
    centre = discs.centres - point
    share = np.clip(line @ centre.T / square[:, None], 0.0, 1.0)
    off = _norm(share[..., None] * line[:, None] - centre)
    result: NDArray[np.bool_] = np.all(off >= discs.radii - _ROUNDING, axis=1)
    return result


def without(point: Array, discs: Discs) -> Discs:
    """Return the ``discs``, reduced where they hold ``point`` (2,)."""
    return discs._replace(radii=np.minimum(discs.radii, _INSIDE * _norm(discs.centres - point)))


def _corners(discs: Discs, low: Array, high: Array) -> Array:
    """Return the corners (k, 2) of polygons around the discs that are in no disc."""
    angles = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=1) / np.cos(np.pi / _CORNERS)
    corners: Array = (discs.centres[:, None] + discs.radii[:, None, None] * unit).reshape(-1, 2)
    outside = (_norm(corners[:, None] - discs.centres) >= discs.radii - _ROUNDING).all(axis=1)
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
