"""Fixed obstacles as convex solids, and the least distance of Bézier curves from them.

Distances are signed: inside a solid the distance is minus that from its surface. For a point p let c be the
unit vector from the point of the surface nearest to p to p, inside a solid the opposite one, and h(c) the
largest c·x of the points x of the solid. The distance of p is c·p − h(c), and no point q is nearer to the
solid, or less deep in it, than c·q − h(c), because the solid is convex. A curve lies in the hull of its
control points q_i, so its least distance is at least min c·q_i − h(c). Where this bound is below the least
distance found at points of the curve so far, the curve is split in two (de Casteljau), and each half has a
bound of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.config.obstacles import Box, Obstacle, Post, Sphere
from companion.values.horizon import Array
from outrider.scenarios.footprints import without_walls

Rows = NDArray[np.int64]
TOLERANCE = 1e-7
"""m by which a least distance may be too large."""
_MOST_SPLITS = 40
_TINY = 1e-12
_ROUNDING = 1e-9
"""m by which a search along the axes is wider, and a distance from outside up to which a point is inside."""


class Least(NamedTuple):
    """Least distances of a plan from K solids, m; infinite where it is further than was asked for.

    ``distance`` (K,): negative inside a solid; ``segment`` (K,) and ``share`` (K,), 0…1 of it: where that is.
    ``hull`` (K,): a lower bound of the distance of the hulls of the control points.
    """

    distance: Array
    segment: Rows
    share: Array
    hull: Array


class Solids:
    """M fixed obstacles, fleet-local ENU, m; walls are boxes, and a post has no lower end.

    ``at`` is the middle of a sphere or a box, and of the top of a post.
    """

    def __init__(self, obstacles: Sequence[Obstacle]) -> None:
        shapes = without_walls(obstacles)
        self._box = np.array([isinstance(one, Box) for one in shapes], dtype=np.bool_)
        self._post = np.array([isinstance(one, Post) for one in shapes], dtype=np.bool_)
        self._at: Array = np.array([_place(one) for one in shapes]).reshape(-1, 3)
        self._half: Array = np.array([_half(one) for one in shapes]).reshape(-1, 3)
        yaw = np.array([radians(one.yaw_deg) if isinstance(one, Box) else 0.0 for one in shapes])
        self._cos, self._sin = np.cos(yaw), np.sin(yaw)
        wide = self._half.copy()
        east, north = self._half[:, 0], self._half[:, 1]
        cos, sin = np.abs(self._cos), np.abs(self._sin)
        wide[self._box, 0] = (cos * east + sin * north)[self._box]
        wide[self._box, 1] = (sin * east + cos * north)[self._box]
        self._low, self._high = self._at - wide, self._at + wide
        self._low[self._post, 2] = -np.inf

    def __len__(self) -> int:
        return len(self._at)

    def near(self, low: Array, high: Array, within: float) -> Rows:
        """Return the rows of the solids that may be nearer than ``within`` (m) to the box of two corners."""
        gap = np.maximum(np.maximum(low - self._high, self._low - high), 0.0)
        return np.flatnonzero(np.vecdot(gap, gap) < (within + _ROUNDING) ** 2)

    def distance(self, points: Array, of: Rows) -> Array:
        """Return the distances (P,), m, of ``points`` (P, 3) from the solids ``of`` (P,); 0 inside."""
        off = points - self._nearest(points, of)
        return np.asarray(np.sqrt(np.vecdot(off, off)))

    def below(self, place: Array, of: Rows) -> Array:
        """Return the distances (P,), m, of the half-line from ``place`` (3,) down from the solids ``of``."""
        points = np.repeat(place[None], len(of), axis=0)
        # The height of the half-line at which a solid is nearest.
        points[:, 2] = np.minimum(points[:, 2], self._at[of, 2])
        return self.distance(points, of)

    def least(self, points: Array, of: Rows, within: float) -> Least:
        """Return the least distances of a plan from the solids ``of`` (K,), where nearer than ``within`` (m).

        ``points`` (n, 3, 3), m: the control points of its segments.
        """
        count = len(of)
        found = Least(
            np.full(count, np.inf), np.zeros(count, np.int64), np.zeros(count), np.full(count, np.inf)
        )
        gap = np.maximum(
            points.min(axis=1)[:, None] - self._high[of], self._low[of] - points.max(axis=1)[:, None]
        )
        gap = np.maximum(gap, 0.0)
        segment, k = np.nonzero(np.vecdot(gap, gap) < (within + _ROUNDING) ** 2)
        q, begin, width = points[segment], np.zeros(len(k)), 1.0
        for split in range(_MOST_SPLITS):
            if not len(k):
                break
            middle = 0.25 * (q[:, 0] + 2.0 * q[:, 1] + q[:, 2])
            lower = np.full(len(k), -np.inf)
            for place, share in ((q[:, 0], 0.0), (middle, 0.5), (q[:, 2], 1.0)):
                distance, bound = self._bound(place, q, of[k])
                _update(found, distance, k, segment, begin + share * width)
                lower = np.maximum(lower, bound)
            if split == 0:
                np.minimum.at(found.hull, k, lower)
            least = found.distance[k]
            open_ = np.flatnonzero(lower < least - TOLERANCE)
            q, middle, k, segment, begin = q[open_], middle[open_], k[open_], segment[open_], begin[open_]
            first, last = 0.5 * (q[:, 0] + q[:, 1]), 0.5 * (q[:, 1] + q[:, 2])
            q = np.concatenate(
                [np.stack([q[:, 0], first, middle], axis=1), np.stack([middle, last, q[:, 2]], axis=1)]
            )
            width *= 0.5
            k, segment = np.concatenate([k, k]), np.concatenate([segment, segment])
            begin = np.concatenate([begin, begin + width])
        return found

    def _bound(self, places: Array, q: Array, of: Rows) -> tuple[Array, Array]:
        """Return the distances (P,), m, of ``places`` (P, 3), and lower bounds (P,) of those of hulls.

        The hulls are those of control points ``q`` (P, 3, 3). Both are signed.
        """
        off = places - self._nearest(places, of)
        distance = np.sqrt(np.vecdot(off, off))
        # The turn of a box and back leaves a rounding error inside it.
        outside = distance > _ROUNDING
        c = off / np.where(outside, distance, 1.0)[:, None]
        inside = np.flatnonzero(~outside)
        distance[inside], c[inside] = self._depth(places[inside], of[inside])
        along = self._turned(c, of)
        across = np.sqrt(np.vecdot(c[:, :2], c[:, :2]))
        radius = self._half[of, 0]
        # c of a post never points down, so its top supports it.
        reach = np.where(self._post[of], radius * across, radius)
        reach = np.where(self._box[of], np.vecdot(np.abs(along), self._half[of]), reach)
        bound = np.vecdot(q - self._at[of][:, None], c[:, None]).min(axis=1) - reach
        return distance, bound

    def _depth(self, places: Array, of: Rows) -> tuple[Array, Array]:
        """Return the distances (P,) ≤ 0, m, of ``places`` (P, 3) inside, and the directions out (P, 3).

        The latter are unit vectors; that of a post points to its side or to its top.
        """
        off, box, post = places - self._at[of], self._box[of], self._post[of]
        along = self._turned(off, of)
        beyond = np.abs(along) - self._half[of]
        face = beyond.argmax(axis=1)
        each = np.arange(len(of))
        flat = np.zeros(off.shape)
        flat[each, face] = np.where(along[each, face] < 0.0, -1.0, 1.0)
        distance = beyond[each, face]
        off[post, 2] = 0.0
        length = np.sqrt(np.vecdot(off, off))
        ball = off / np.where(length > _TINY, length, 1.0)[:, None]
        ball[length <= _TINY] = 1.0, 0.0, 0.0
        beside, above = length - self._half[of, 0], places[:, 2] - self._at[of, 2]
        ball[post & (above > beside)] = 0.0, 0.0, 1.0
        round_ = np.where(post, np.maximum(beside, above), beside)
        ways = np.where(box[:, None], self._turned(flat, of, back=True), ball)
        return np.where(box, distance, round_), ways

    def _nearest(self, points: Array, of: Rows) -> Array:
        """Return the points (P, 3) of the solids ``of`` (P,) that are nearest to ``points`` (P, 3), m."""
        off, half = points - self._at[of], self._half[of]
        box, post = self._box[of], self._post[of]
        along = self._turned(off, of)
        flat = self._turned(np.clip(along, -half, half), of, back=True)
        off_axis = off.copy()
        off_axis[post, 2] = 0.0
        length = np.sqrt(np.vecdot(off_axis, off_axis))
        ball = off * np.minimum(1.0, half[:, 0] / np.maximum(length, _TINY))[:, None]
        ball[post, 2] = np.minimum(off[post, 2], 0.0)
        return self._at[of] + np.where(box[:, None], flat, ball)

    def _turned(self, vectors: Array, of: Rows, *, back: bool = False) -> Array:
        """Return ``vectors`` (P, 3) along the own axes of the solids ``of``, or ``back`` from these."""
        cos, sin = self._cos[of], -self._sin[of] if back else self._sin[of]
        x, y, z = vectors.T
        return np.stack([cos * x + sin * y, cos * y - sin * x, z], axis=1)


def _update(found: Least, distance: Array, k: Rows, segment: Rows, share: Array) -> None:
    """Write the ``distance`` (P,) of points of the curve to ``found`` where it is the least of its solid."""
    order = np.lexsort((distance, k))
    rows, first = np.unique(k[order], return_index=True)
    best = order[first]
    better = distance[best] < found.distance[rows]
    rows, best = rows[better], best[better]
    found.distance[rows], found.segment[rows], found.share[rows] = distance[best], segment[best], share[best]


def _place(one: Sphere | Post | Box) -> tuple[float, float, float]:
    return (*one.at, one.height) if isinstance(one, Post) else one.at


def _half(one: Sphere | Post | Box) -> tuple[float, float, float]:
    """Return half of the size of a box, and radii; a post ends at its place."""
    if isinstance(one, Box):
        x, y, z = one.size
        return 0.5 * x, 0.5 * y, 0.5 * z
    return one.radius, one.radius, 0.0 if isinstance(one, Post) else one.radius
