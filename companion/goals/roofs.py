"""Ways out from above or below a box for a vehicle that is to land. Heights do not count: seen from above."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from companion.avoidance.certified.visibility_graph import rectangles
from companion.config.obstacles import Obstacle, Post, Sphere
from companion.obstacles.boxes import box_of, boxes_of
from companion.values.boxes import BoxIndex
from companion.values.horizon import Array


class Roofs:
    """Fixed obstacles seen from above: rectangles of boxes and walls, circles of posts and spheres; m."""

    def __init__(self, obstacles: Sequence[Obstacle]) -> None:
        flat = [k for k, one in enumerate(obstacles) if box_of(one) is not None]
        self._rows = {number: row for row, number in enumerate(flat)}
        self._boxes = boxes_of(obstacles)
        self._index = BoxIndex(self._boxes)
        circles = [one for one in obstacles if isinstance(one, Sphere | Post)]
        self._centres: Array = np.array([one.at[:2] for one in circles]).reshape(-1, 2)
        self._radii: Array = np.array([one.radius for one in circles], dtype=np.float64)

    def way_out(
        self, number: int, here: Array, distance: float, clear: float, low: Array, high: Array
    ) -> Array | None:
        """Return the nearest place (2,), m, ``distance`` (m) beside the box that is obstacle ``number``.

        It is one of the four straight out of the rectangle above which ``here`` (2,), m, is: no place at that
        distance is nearer than the first of them. It is between the corners ``low`` and ``high`` (2,) and at
        least ``clear`` (m) from all other obstacles. None if there is no such place, if ``here`` is beside
        the rectangle, or if the obstacle is no box.
        """
        row = self._rows.get(number)
        if row is None:
            return None
        cos, sin = self._boxes.turns[row]
        axes = np.array([[cos, sin], [-sin, cos]])
        half = self._boxes.halves[row, :2]
        along = axes @ (here - self._boxes.centres[row, :2])
        if (np.abs(along) > half).any():
            return None
        ways = np.concatenate([half - along, half + along]) + distance
        for k in np.argsort(ways, kind="stable").tolist():
            place: Array = here + (1.0 if k < 2 else -1.0) * ways[k] * axes[k % 2]
            inside = (low <= place).all() and (place <= high).all()
            if inside and self._distance(place, row, clear) >= clear:
                return place
        return None

    def _distance(self, place: Array, own: int, within: float) -> float:
        """Return the distance (m) of ``place`` (2,) from all but the box in the row ``own``.

        Boxes further away than ``within`` (m) may be left out.
        """
        rows = self._index.near(place - within, place + within)
        beside = rectangles(self._boxes.chosen(rows[rows != own])).distance(place[None])
        circles = np.linalg.norm(place - self._centres, axis=1) - self._radii
        return float(min(beside.min(initial=np.inf), circles.min(initial=np.inf)))
