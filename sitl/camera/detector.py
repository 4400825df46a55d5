"""Detection of the tracked object in one image.

A detection is what a tracker measures: the extent of the object in the image. Its errors are those of the
edges (pixels), and of the height: an object that stoops looks like a distant one of the known height.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from mavlink_bridge.pinhole import (
    Extent,
    Pinhole,
    Quaternion,
    Vector,
    conjugate,
    extent,
    foot,
    rotated,
    upward,
)
from sitl.camera.occlusion import Body, Point, hidden
from sitl.values.camera import CameraConfig

_NEAREST = 0.2
"""m in front of the camera: nothing nearer is sharp."""
_FALSE_NEAREST = 2.0


class View(NamedTuple):
    """Place (m, site NED) and attitude (camera axes to NED) of a camera when it took an image."""

    place: Point
    attitude: Quaternion


class Draws(NamedTuple):
    """Random numbers of one image: as many for every image, whatever is seen in it.

    ``missed``, ``false``, ``column``, ``row`` and ``distance`` are uniform in 0…1, the others normal.
    """

    missed: float
    false: float
    column: float
    row: float
    distance: float
    across: float
    top: float
    foot: float
    height: float

    @staticmethod
    def of(random: np.random.Generator) -> Draws:
        """Return the next random numbers."""
        return Draws(*random.random(5).tolist(), *random.standard_normal(4).tolist())


class Detector:
    """Detector of a camera with the settings ``config``."""

    def __init__(self, config: CameraConfig) -> None:
        self._config = config
        self.camera: Pinhole = config.pinhole

    def detect(self, view: View, target: Point | None, bodies: Iterable[Body], draws: Draws) -> Extent | None:
        """Return what is detected in the image from ``view``, None if nothing is.

        ``target``: foot of the object (m, site NED), None if there is none.
        """
        config = self._config
        up = upward(view.attitude)
        if draws.false < config.false_positives:
            found = self._imagined(up, draws)
        elif target is None or draws.missed < config.missed:
            return None
        else:
            found = self._seen(view, target, up, bodies)
        return None if found is None else self._measured(found, up, draws)

    def visible(self, view: View, target: Point, bodies: Iterable[Body]) -> bool:
        """Return whether the whole object with its foot at ``target`` (m, site NED) shows in the image."""
        return self._seen(view, target, upward(view.attitude), bodies) is not None

    def _seen(self, view: View, target: Point, up: Vector, bodies: Iterable[Body]) -> Extent | None:
        config, height = self._config, self._config.object.height
        north, east, down = (b - a for a, b in zip(view.place, target, strict=True))
        low = rotated(conjugate(view.attitude), (north, east, down))
        top = (low[0] + height * up[0], low[1] + height * up[1], low[2] + height * up[2])
        if math.hypot(north, east, down) > config.range or min(low[0], top[0]) < _NEAREST:
            return None
        camera = self.camera
        if not (camera.shows(*camera.pixel(low)) and camera.shows(*camera.pixel(top))):
            return None
        found = extent(camera, low, up, height)
        if found.foot - found.top < config.least_pixels:
            return None
        x, y, z = target
        points = ((x, y, z), (x, y, z - 0.5 * height), (x, y, z - height))
        return None if hidden(view.place, points, bodies) else found

    def _measured(self, seen: Extent, up: Vector, draws: Draws) -> Extent | None:
        """Return an extent with the errors of its edges and of the object's height."""
        sigma, known = self._config.pixel_sigma, self._config.object
        column = seen.column + sigma * draws.across
        measured = Extent(column, seen.top + sigma * draws.top, seen.foot + sigma * draws.foot)
        if not known.height_sigma:
            return measured
        place = foot(self.camera, measured, up, known.height + known.height_sigma * draws.height)
        if place is None or min(place[0], place[0] + known.height * up[0]) < _NEAREST:
            return None
        return extent(self.camera, place, up, known.height)

    def _imagined(self, up: Vector, draws: Draws) -> Extent | None:
        """Return the extent of an object that is not there, anywhere in the image and at any distance."""
        config, camera = self._config, self.camera
        along = camera.ray(draws.column * camera.width, draws.row * camera.height)
        length = math.hypot(*along)
        least = min(_FALSE_NEAREST, config.range)
        distance = least + draws.distance * (config.range - least)
        low = (along[0] * distance / length, along[1] * distance / length, along[2] * distance / length)
        if low[0] + config.object.height * up[0] < _NEAREST:
            return None
        return extent(camera, low, up, config.object.height)
