"""Fixed obstacles that every companion is configured with: spheres, posts on the ground, boxes and walls.

For the field and its methods each obstacle is a point on its axis (for a sphere: its centre), enlarged by
``radius``: the point of the axis nearest to the predicted position, so that the force is horizontal
beside a post and points up above it. For a box it is the nearest point of its surface, with radius 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.config.obstacles import Obstacle, Post, Sphere
from companion.obstacles.boxes import boxes_of
from companion.values.boxes import BoxIndex, beside, distances
from companion.values.horizon import Array

FIRST_ID = 1000
"""Ids of fixed obstacles begin here: above every system id."""


class Axes(NamedTuple):
    """Obstacles near a vehicle: ids (M,), nearest points of their axes (M, N + 1, 3) and radii (M,), m."""

    ids: tuple[int, ...]
    positions: Array
    radius: Array


class FixedObstacles:
    """All fixed obstacles as arrays: those round, and an index of those that are boxes.

    Of R round ones: x, y of the axis (R, 2), its range of z (R,), radius (R,); m.
    """

    def __init__(self, obstacles: Sequence[Obstacle]) -> None:
        round_ = [one for one in obstacles if isinstance(one, Sphere | Post)]
        is_round = np.array([isinstance(one, Sphere | Post) for one in obstacles], dtype=bool)
        self._round, self._flat = np.flatnonzero(is_round), np.flatnonzero(~is_round)
        self._ids = self._round + FIRST_ID
        self._xy: Array = np.array([o.at[:2] for o in round_]).reshape(-1, 2)
        self._low: Array = np.array([o.at[2] if isinstance(o, Sphere) else -np.inf for o in round_])
        self._high: Array = np.array([o.at[2] if isinstance(o, Sphere) else o.height for o in round_])
        self._ball = np.array([isinstance(o, Sphere) for o in round_], dtype=bool)
        self._radius: Array = np.array([o.radius for o in round_], dtype=np.float64)
        self._boxes = BoxIndex(boxes_of(obstacles))

    def __len__(self) -> int:
        return len(self._round) + len(self._flat)

    def around(self, prediction: Array, reach: float) -> Axes:
        """Return the obstacles near the predicted positions (N + 1, 3).

        These are, as seen from above, all round ones whose surface reaches the bounding rectangle of the
        predicted positions, extended by ``reach`` (m), and all boxes within ``reach`` of a predicted place.
        Heights do not count, because a vehicle that lands must not land on what is far below.
        """
        low, high = prediction[:, :2].min(axis=0) - reach, prediction[:, :2].max(axis=0) + reach
        off = np.maximum(np.maximum(low - self._xy, self._xy - high), 0.0)
        near = np.flatnonzero((off * off).sum(axis=1) <= self._radius**2)
        positions = np.empty((len(near), len(prediction), 3))
        positions[..., :2] = self._xy[near, None]
        positions[..., 2] = np.clip(prediction[None, :, 2], self._low[near, None], self._high[near, None])
        found = Axes(tuple(self._ids[near].tolist()), positions, self._radius[near])
        if not len(self._flat):
            return found
        rows = self._boxes.near(low, high)
        places, least = beside(prediction, self._boxes.boxes.chosen(rows))
        kept = np.flatnonzero(least <= reach)
        ids = self._flat[rows[kept]] + FIRST_ID
        return Axes(
            (*found.ids, *ids.tolist()),
            np.concatenate([found.positions, places[kept]]),
            np.concatenate([found.radius, np.zeros(len(kept))]),
        )

    def distance(self, positions: Array) -> Array:
        """Return the distances (…, M), m, from points (…, 3) to every surface; negative inside."""
        off = positions[..., None, :2] - self._xy
        above = positions[..., 2, None] - self._high
        surfaces = to_surface(np.sqrt(np.vecdot(off, off)), above, self._ball, self._radius)
        if not len(self._flat):
            return surfaces
        found = np.empty((*positions.shape[:-1], len(self)))
        found[..., self._round] = surfaces
        found[..., self._flat] = distances(positions, self._boxes.boxes)
        return found


def to_surface(across: Array, above: Array, ball: NDArray[np.bool_], radius: Array) -> Array:
    """Return the distances (…, M), m, of points from the surfaces of spheres and posts; negative inside.

    ``ball`` (M,): whether the obstacle is a sphere; ``radius`` (M,), m. The points are ``across`` (…, M) from
    the axes and ``above`` (…, M) a sphere's centre or a post's top, which is flat.
    """
    beside = across - radius
    outside = np.sqrt(np.maximum(beside, 0.0) ** 2 + np.maximum(above, 0.0) ** 2)
    post = np.where((beside < 0.0) & (above < 0.0), np.maximum(beside, above), outside)
    result: Array = np.where(ball, np.sqrt(across**2 + above**2) - radius, post)
    return result
