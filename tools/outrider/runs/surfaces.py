"""Distances from the surfaces of fixed obstacles; of many obstacles only those near are computed."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.config.obstacles import Box, Obstacle, Post, Sphere
from companion.obstacles.static import to_surface
from outrider.scenarios.footprints import without_walls

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
_SPAN = 50
"""Number of consecutive points of a path for which nearby obstacles are searched together."""
_MARGIN = 1.0
"""m by which the region for which obstacles are searched is wider than a path."""
_ROUNDING = 1e-9
"""m by which a computed bound of a distance may be too large."""


class Pairs(NamedTuple):
    """Pairs (P,) of a vehicle and an obstacle, as rows."""

    vehicle: Rows
    obstacle: Rows


class Surfaces:
    """Surfaces of M fixed obstacles, fleet-local ENU, m.

    Boxes and walls are solid with upright sides; a post has no lower end. Distances to boxes are not computed
    by the companion's functions, so that a fault of these shows.
    """

    def __init__(self, obstacles: Sequence[Obstacle]) -> None:
        shapes = [_shape(one) for one in without_walls(obstacles)]
        self._kind = np.array([shape.kind for shape in shapes], dtype="U6")
        self._at: Array = np.array([shape.at for shape in shapes]).reshape(-1, 3)
        self._half: Array = np.array([shape.half for shape in shapes]).reshape(-1, 3)
        self._turn: Array = np.array([shape.turn for shape in shapes]).reshape(-1, 2)
        self._low, self._high = self._bounds()

    def __len__(self) -> int:
        return len(self._at)

    def distance(self, points: Array, of: Rows) -> Array:
        """Return the distances (…, P), m, of points (…, P, 3) from the obstacles in the rows ``of`` (P,).

        They are negative inside an obstacle; NaN where the point is missing.
        """
        off = points - self._at[of]
        found = np.empty(off.shape[:-1])
        box = self._kind[of] == "box"
        if box.any():
            found[..., box] = _to_box(off[..., box, :], self._half[of[box]], self._turn[of[box]])
        if not box.all():
            off, of = off[..., ~box, :], of[~box]
            across = np.sqrt(np.vecdot(off[..., :2], off[..., :2]))
            ball = np.asarray(self._kind[of] == "sphere")
            found[..., ~box] = to_surface(across, off[..., 2], ball, self._half[of, 0])
        return found

    def near(self, low: Array, high: Array, within: float) -> Rows:
        """Return the obstacles that may be nearer than ``within`` (m) to a point between two corners (3,).

        They are those whose bounds along the axes are nearer to those of the corners.
        """
        gap = np.maximum(np.maximum(low - self._high, self._low - high), 0.0)
        return np.flatnonzero(np.sqrt(np.vecdot(gap, gap)) < within + _ROUNDING)

    def nearest(self, positions: Array) -> Array:
        """Return the distances (T, K), m, from positions (T, K, 3) to the nearest surface.

        Infinite without obstacles; NaN where the position is missing.
        """
        found = np.where(np.isnan(positions).any(axis=2), np.nan, np.inf)
        if not len(self):
            return found
        for k in range(positions.shape[1]):
            for first in range(0, len(positions), _SPAN):
                rows = first + np.flatnonzero(np.isinf(found[first : first + _SPAN, k]))
                if len(rows):
                    found[rows, k] = self._nearest(positions[rows, k])
        return found

    def _nearest(self, path: Array) -> Array:
        """Return the distances (n,), m, of points (n, 3) near each other to the nearest surface."""
        middle = path[len(path) // 2]
        # No point is further from the nearest surface than the middle is, and its own distance from that.
        here = float(self.distance(middle, np.arange(len(self))).min())
        within = max(here, 0.0) + float(np.sqrt(np.vecdot(path - middle, path - middle)).max())
        near = self.near(path.min(axis=0), path.max(axis=0), within + _ROUNDING)
        least: Array = self.distance(path[:, None], near).min(axis=1)
        return least

    def _bounds(self) -> tuple[Array, Array]:
        """Return the lower and the upper corners (M, 3) of the bounds along the axes."""
        cosine, sine = np.abs(self._turn.T)
        east, north, up = self._half.T
        reach = np.stack([cosine * east + sine * north, sine * east + cosine * north, up], axis=1)
        low, high = self._at - reach, self._at + reach
        low[self._kind == "post", 2] = -np.inf
        return low, high


class Nearby:
    """Pairs of K vehicles and obstacles that may be near each other while the vehicles move.

    They are searched again only for a vehicle that left the region for which they were searched.
    """

    def __init__(self, surfaces: Surfaces, vehicles: int) -> None:
        self._surfaces = surfaces
        self._low = np.full((vehicles, 3), np.inf)
        self._high = np.full((vehicles, 3), -np.inf)
        none = np.empty(0, dtype=np.int64)
        self._of = [none] * vehicles
        self._pairs = Pairs(none, none)

    def pairs(self, track: Array, within: float) -> Pairs:
        """Return all pairs that may be nearer than ``within`` (m) somewhere on ``track`` (n, K, 3).

        ``within`` must not increase from call to call. A vehicle without any position (NaN) keeps its pairs.
        """
        low, high = np.fmin.reduce(track), np.fmax.reduce(track)
        left = np.flatnonzero(((low < self._low) | (high > self._high)).any(axis=1))
        for k in left.tolist():
            self._low[k], self._high[k] = low[k] - _MARGIN, high[k] + _MARGIN
            self._of[k] = self._surfaces.near(self._low[k], self._high[k], within)
        if len(left):
            vehicles = np.repeat(np.arange(len(self._of)), [len(of) for of in self._of])
            self._pairs = Pairs(vehicles, np.concatenate(self._of))
        return self._pairs


class _Shape(NamedTuple):
    """Kind, place, half size (m), and cosine and sine of the turn of an obstacle.

    The place is the middle; of a post, the middle of its top.
    """

    kind: str
    at: tuple[float, float, float]
    half: tuple[float, float, float]
    turn: tuple[float, float] = (1.0, 0.0)


def _shape(obstacle: Sphere | Post | Box) -> _Shape:
    if isinstance(obstacle, Box):
        along, aside, up = obstacle.size
        yaw = radians(obstacle.yaw_deg)
        return _Shape("box", obstacle.at, (0.5 * along, 0.5 * aside, 0.5 * up), (cos(yaw), sin(yaw)))
    if isinstance(obstacle, Post):
        return _Shape("post", (*obstacle.at, obstacle.height), (obstacle.radius, obstacle.radius, 0.0))
    return _Shape("sphere", obstacle.at, (obstacle.radius,) * 3)


def _to_box(off: Array, half: Array, turn: Array) -> Array:
    """Return the distances (…, P), m, from the surfaces of boxes with half sizes (P, 3); negative inside.

    The points are ``off`` (…, P, 3) their middles; ``turn`` (P, 2): cosine and sine of their yaw.
    """
    cosine, sine = turn.T
    along = np.abs(cosine * off[..., 0] + sine * off[..., 1]) - half[:, 0]
    aside = np.abs(cosine * off[..., 1] - sine * off[..., 0]) - half[:, 1]
    above = np.abs(off[..., 2]) - half[:, 2]
    most = np.maximum(np.maximum(along, aside), above)
    outside = np.sqrt(np.maximum(along, 0.0) ** 2 + np.maximum(aside, 0.0) ** 2 + np.maximum(above, 0.0) ** 2)
    result: Array = np.where(most < 0.0, most, outside)
    return result
