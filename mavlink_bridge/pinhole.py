"""Pinhole camera, and the place of an upright object of known height from its extent in an image.

Camera axes: x along the optical axis (forward), y to the right and z down in the image. Rows count down and
columns to the right, from the upper left corner (pixels). Attitudes are quaternions (w, x, y, z) that rotate
camera axes to NED. An object is the vertical line from its foot, its reference point, up to its height.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Array = npt.NDArray[np.float64]


class Pinhole(NamedTuple):
    """Optics: ``width`` and ``height`` of the image and focal length ``focal`` (pixels).

    Pixels are square, and the optical axis meets the centre of the image.
    """

    width: int
    height: int
    focal: float

    @staticmethod
    def of_field(width: int, height: int, horizontal_field: float) -> Pinhole:
        """Return the camera with ``width`` × ``height`` pixels and a horizontal angle of view (rad)."""
        return Pinhole(width, height, 0.5 * width / math.tan(0.5 * horizontal_field))

    @property
    def fields(self) -> tuple[float, float]:
        """Angles of view (rad): horizontal, vertical."""
        return 2.0 * math.atan2(0.5 * self.width, self.focal), 2.0 * math.atan2(0.5 * self.height, self.focal)

    def pixel(self, point: Vector) -> tuple[float, float]:
        """Return column and row of ``point`` (m, camera axes), which must be in front of the camera."""
        forward, right, down = point
        return (
            0.5 * self.width + self.focal * right / forward,
            0.5 * self.height + self.focal * down / forward,
        )

    def ray(self, column: float, row: float) -> Vector:
        """Return the direction of a pixel (camera axes), with a forward component of 1."""
        return 1.0, (column - 0.5 * self.width) / self.focal, (row - 0.5 * self.height) / self.focal

    def shows(self, column: float, row: float) -> bool:
        """Return whether a pixel is in the image."""
        return 0.0 <= column <= self.width and 0.0 <= row <= self.height


class Extent(NamedTuple):
    """Extent of an upright object in an image: rows of ``top`` and ``foot``, ``column`` midway between them.

    Pixels, not rounded.
    """

    column: float
    top: float
    foot: float


def extent(camera: Pinhole, foot: Vector, up: Vector, height: float) -> Extent:
    """Return the extent of an object with its foot at ``foot`` (m, camera axes), in front of the camera.

    ``up``: unit vector of the vertical in camera axes; ``height`` of the object (m).
    """
    top = (foot[0] + height * up[0], foot[1] + height * up[1], foot[2] + height * up[2])
    (left, low), (right, high) = camera.pixel(foot), camera.pixel(top)
    return Extent(0.5 * (left + right), high, low)


def foot(camera: Pinhole, seen: Extent, up: Vector, height: float) -> Vector | None:
    """Return the foot (m, camera axes) of an object of known ``height`` (m): the inverse of ``extent``.

    It is proportional to the height. Returns None if no object in front of the camera looks like that.
    """
    _, u, top = camera.ray(seen.column, seen.top)
    low = camera.ray(seen.column, seen.foot)[2]
    ahead, aside, below = up
    if top == low:
        return None
    depth = height * (below - top * ahead) / (top - low)
    depth_of_top = depth + height * ahead
    if not (math.isfinite(depth) and depth > 0.0 and depth_of_top > 0.0):
        return None
    right = depth * (2.0 * u * depth_of_top - height * aside) / (depth + depth_of_top)
    return depth, right, low * depth


def covariance(
    camera: Pinhole, seen: Extent, up: Vector, height: float, pixel_sigma: float, height_sigma: float
) -> Array:
    """Return the covariance (3, 3) (m², camera axes) of ``foot``, to the first order.

    ``pixel_sigma`` (pixels): of the column and of each row, independent of each other. ``height_sigma`` (m):
    of the known height. Raises ValueError if ``foot`` returns None.
    """
    place = foot(camera, seen, up, height)
    if place is None:
        raise ValueError(f"{seen} shows no object in front of the camera")
    jacobian = _jacobian(camera, seen, up, height)
    along = np.array(place) * (height_sigma / height)
    found: Array = pixel_sigma**2 * (jacobian @ jacobian.T) + np.outer(along, along)
    return found


def _jacobian(camera: Pinhole, seen: Extent, up: Vector, height: float) -> Array:
    """Return the derivatives (3, 3) of ``foot`` with respect to column, top and foot (m per pixel)."""
    _, u, top = camera.ray(seen.column, seen.top)
    low = camera.ray(seen.column, seen.foot)[2]
    ahead, aside, below = up
    numerator, denominator = below - top * ahead, top - low
    depth = height * numerator / denominator
    other = depth + height * ahead
    by_top = -height * (ahead * denominator + numerator) / denominator**2
    by_low = height * numerator / denominator**2
    total = depth + other
    product = 2.0 * u * other - height * aside
    by_depth = (product + 2.0 * u * depth) / total - 2.0 * depth * product / total**2
    return (
        np.array(
            [
                [0.0, by_top, by_low],
                [2.0 * depth * other / total, by_depth * by_top, by_depth * by_low],
                [0.0, low * by_top, depth + low * by_low],
            ]
        )
        / camera.focal
    )


class Sighting(NamedTuple):
    """Place of an object relative to the camera: ``offset`` (m) and its covariance ``errors`` (3, 3), NED.

    Accuracies are standard deviations, of what CAMERA_TRACKING_GEO_STATUS (276) says.
    """

    offset: Vector
    errors: Array

    @property
    def level(self) -> float:
        """Horizontal distance (m); at 0 there is no heading."""
        return math.hypot(self.offset[0], self.offset[1])

    @property
    def distance(self) -> float:
        """Distance (m)."""
        return math.hypot(self.level, self.offset[2])

    @property
    def heading(self) -> float:
        """Direction (rad, clockwise from north)."""
        return math.atan2(self.offset[1], self.offset[0])

    @property
    def horizontal_accuracy(self) -> float:
        """√(σ_along² + σ_across²), m."""
        return _root(self.errors[0, 0] + self.errors[1, 1])

    @property
    def vertical_accuracy(self) -> float:
        """Of the altitude, m."""
        return _root(self.errors[2, 2])

    @property
    def heading_accuracy(self) -> float:
        """Of the heading, rad."""
        north, east, _ = self.offset
        across = np.array((-east / self.level, north / self.level, 0.0))
        return _root(across @ self.errors @ across) / self.level


def sighting(
    camera: Pinhole,
    attitude: Quaternion,
    seen: Extent,
    height: float,
    pixel_sigma: float,
    height_sigma: float,
) -> Sighting | None:
    """Return where an object of known ``height`` (m) is, seen from a camera with that attitude.

    Arguments as of ``covariance``. Returns None if no object in front of the camera looks like that.
    """
    up = upward(attitude)
    place = foot(camera, seen, up, height)
    if place is None:
        return None
    turn = matrix(attitude)
    errors = turn @ covariance(camera, seen, up, height, pixel_sigma, height_sigma) @ turn.T
    return Sighting(rotated(attitude, place), errors)


def _root(square: float) -> float:
    """Return the root of a sum of squares that rounding may have made negative."""
    return math.sqrt(max(0.0, square))


def upward(attitude: Quaternion) -> Vector:
    """Return the vertical, upward, in camera axes."""
    w, x, y, z = attitude
    return -2.0 * (x * z - w * y), -2.0 * (y * z + w * x), -(1.0 - 2.0 * (x * x + y * y))


def product(first: Quaternion, second: Quaternion) -> Quaternion:
    """Return the rotation that applies ``second``, then ``first``."""
    a, b, c, d = first
    w, x, y, z = second
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def conjugate(rotation: Quaternion) -> Quaternion:
    """Return the inverse of a rotation."""
    w, x, y, z = rotation
    return w, -x, -y, -z


def rotated(rotation: Quaternion, vector: Vector) -> Vector:
    """Return ``vector`` rotated: with an attitude, from camera axes to NED."""
    w, x, y, z = rotation
    a, b, c = vector
    # v + 2 w (q × v) + 2 q × (q × v)
    u, v, t = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + 2.0 * (w * u + y * t - z * v),
        b + 2.0 * (w * v + z * u - x * t),
        c + 2.0 * (w * t + x * v - y * u),
    )


def matrix(rotation: Quaternion) -> Array:
    """Return the rotation as a matrix (3, 3)."""
    return np.array(
        [rotated(rotation, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    ).T
