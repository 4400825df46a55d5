"""Fixed obstacles of a vehicle, and the distance that its plans keep from their surfaces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.certified.margins import from_surfaces
from companion.config import CompanionConfig
from companion.config.obstacles import Post, Sphere
from companion.obstacles.boxes import boxes_of
from companion.obstacles.static import FixedObstacles
from companion.values.boxes import BoxIndex, distances
from companion.values.horizon import Array


class FixedSurfaces:
    """Posts, balls and boxes of one vehicle; its plans and its ways share them."""

    def __init__(self, config: CompanionConfig) -> None:
        self.least = from_surfaces(config.certified, config.field, config.limits)
        """Least distance (m) of a plan from a surface."""
        self.round = [one for one in config.obstacles if isinstance(one, Post | Sphere)]
        self.posts = FixedObstacles([one for one in self.round if isinstance(one, Post)])
        self.balls = FixedObstacles([one for one in self.round if isinstance(one, Sphere)])
        self.boxes = BoxIndex(boxes_of(config.obstacles))

    def clear(self, places: Array) -> NDArray[np.bool_]:
        """Return whether ``places`` (n, 3), m, are as far from all fixed obstacles as plans keep, (n,).

        Posts act as if they had no top.
        """
        clear = (self.balls.distance(places) >= self.least).all(axis=1)
        below = places.copy()
        below[:, 2] = -np.inf
        clear &= (self.posts.distance(below) >= self.least).all(axis=1)
        clear &= (distances(places, self.boxes.boxes) >= self.least).all(axis=1)
        return np.asarray(clear)
