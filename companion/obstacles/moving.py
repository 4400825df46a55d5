"""Moving obstacles: spheres and posts that report their positions on the swarm link.

Each has a system id of its own. Its position and prediction are received like a neighbour's: a track, and a
horizon if it shares one. Its size is configured. Its reported position counts as exact, like the position of
a fixed obstacle, so that a moving obstacle at rest has the same effect as a fixed one of its size.
"""

from __future__ import annotations

import numpy as np

from companion.config.obstacles import MovingPost, MovingSphere
from companion.obstacles.static import to_surface
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles


class MovingObstacles:
    """Sizes of M moving obstacles: whether sphere or post (M,), radii (M,) and tops of the posts (M,), m."""

    def __init__(self, moving: tuple[MovingSphere | MovingPost, ...]) -> None:
        self._rows = {one.system: k for k, one in enumerate(moving)}
        self._ball = np.array([isinstance(one, MovingSphere) for one in moving], dtype=bool)
        self._radius: Array = np.array([one.radius for one in moving], dtype=np.float64)
        self._top: Array = np.array([one.height if isinstance(one, MovingPost) else np.inf for one in moving])

    def __len__(self) -> int:
        return len(self._radius)

    def among(
        self,
        others: Obstacles,
        prediction: Array,
        d_min: float,
        d_safe: float,
        margin: float,
        vehicles: float,
    ) -> Obstacles:
        """Return ``others`` with the configured sizes of the moving obstacles among them.

        ``d_min`` and ``d_safe`` (m, for a point) grow by the radius and ``margin``. A post is placed at the
        point of its axis nearest to the own ``prediction`` (N + 1, 3). ``vehicles`` (m) is the margin that
        ``others`` contains as the radius of a vehicle; where a radius exceeds it, the excess is the
        uncertainty of the position, by which the obstacle is enlarged.
        """
        found = [(j, self._rows[name]) for j, name in enumerate(others.ids) if name in self._rows]
        if not found:
            return others
        here, rows = (list(part) for part in zip(*found, strict=True))
        positions, least, safe = others.positions.copy(), others.d_min.copy(), others.d_safe.copy()
        radius = np.broadcast_to(others.radius, len(others.ids)).copy()
        radius[here] = self._radius[rows] + margin + (radius[here] - vehicles)
        least[here], safe[here] = d_min + radius[here], d_safe + radius[here]
        for j, row in found:
            if not self._ball[row]:
                positions[j, :, 2] = np.minimum(prediction[:, 2], self._top[row])
        heights = np.broadcast_to(others.heights, len(others.ids)).copy()
        heights[here] = 1.0
        return Obstacles(others.ids, positions, least, safe, radius, heights)

    def distance(self, points: Array, places: Array) -> Array:
        """Return the distances (…, K, M), m, from ``points`` (…, K, 3) to obstacles at ``places`` (…, M, 3).

        Distances are measured to the surfaces and are negative inside.
        """
        off = points[..., :, None, :2] - places[..., None, :, :2]
        top = np.where(self._ball, places[..., 2], self._top)
        above = points[..., :, None, 2] - top[..., None, :]
        return to_surface(np.sqrt(np.vecdot(off, off)), above, self._ball, self._radius)
