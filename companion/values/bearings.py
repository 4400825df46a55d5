"""Bearings seen from above: ENU, rad, from east towards north."""

from __future__ import annotations

from math import atan2, cos, pi, sin

import numpy as np

from companion.values.horizon import Array


def bearing(origin: Array, point: Array) -> float:
    """Return the horizontal bearing (rad) of ``point`` seen from ``origin``; 0 if they coincide.

    It is the arctangent of two arguments; that of the paper's quotient (Sec. III-B) is the same for opposite
    directions.
    """
    return atan2(point[1] - origin[1], point[0] - origin[0])


def wrapped(angles: Array) -> Array:
    """Return the same angles in [−π, π)."""
    result: Array = (angles + pi) % (2.0 * pi) - pi
    return result


def rotated(vector: tuple[float, float, float], angle: float) -> tuple[float, float, float]:
    """Return ``vector`` rotated about the vertical by ``angle`` (rad), counter-clockwise from above."""
    c, s = cos(angle), sin(angle)
    x, y, z = vector
    return c * x - s * y, s * x + c * y, z


def turned(vector: Array, angle: float) -> Array:
    """Return ``vector`` (3,) ``rotated`` by ``angle`` (rad)."""
    x, y, z = vector.tolist()
    return np.array(rotated((x, y, z), angle))
