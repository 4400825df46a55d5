"""Fixed obstacles seen from above: circles, and rectangles of boxes and walls. Fleet-local ENU, m."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin

import numpy as np
from numpy.typing import NDArray

from companion.config.obstacles import Box, Obstacle, Post, Sphere, Wall

Array = NDArray[np.float64]

_LEAST_AROUND = 5.0


def without_walls(obstacles: Sequence[Obstacle]) -> list[Sphere | Post | Box]:
    """Return the obstacles in their order, each wall as a box."""
    return [one.box if isinstance(one, Wall) else one for one in obstacles]


def circles(obstacles: Sequence[Obstacle]) -> list[tuple[float, float, float]]:
    """Return east, north and radius of spheres and posts, in their order."""
    return [(*one.at[:2], one.radius) for one in obstacles if isinstance(one, Sphere | Post)]


def rectangles(obstacles: Sequence[Obstacle]) -> Array:
    """Return the corners (M, 4, 2) of boxes and walls, in their order, each counter-clockwise."""
    boxes = [_corners(one) for one in without_walls(obstacles) if isinstance(one, Box)]
    return np.array(boxes).reshape(-1, 4, 2)


def beside(corners: Array, flown: Array) -> Array:
    """Return those of ``corners`` (…, 2) near the places ``flown`` (n, 2), m, (k, 2): a picture holds them.

    They are at most half the extent of these places away, or 5 m: a world may be far larger than a flight.
    """
    places = flown[np.isfinite(flown).all(axis=1)]
    if not len(places):
        return corners.reshape(-1, 2)
    low, high = places.min(axis=0), places.max(axis=0)
    wide = max(_LEAST_AROUND, 0.5 * float((high - low).max()))
    points = corners.reshape(-1, 2)
    near: Array = points[((points >= low - wide) & (points <= high + wide)).all(axis=1)]
    return near


def _corners(box: Box) -> Array:
    yaw = radians(box.yaw_deg)
    along = 0.5 * box.size[0] * np.array([cos(yaw), sin(yaw)])
    aside = 0.5 * box.size[1] * np.array([-sin(yaw), cos(yaw)])
    middle = np.array(box.at[:2])
    return np.array([middle + a * along + b * aside for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
