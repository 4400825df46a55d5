"""Destination surfaces around the target, and the yaw that faces it (Algorithm 1, lines 1 and 4)."""

from __future__ import annotations

from math import atan2, cos, sin

import numpy as np

from companion.horizon import Array


def bearing(origin: Array, point: Array) -> float:
    """Horizontal bearing of ``point`` seen from ``origin``: ENU, rad, from east towards north.

    Two arguments, not the paper's quotient, which loses the half plane. Zero if the points coincide.
    """
    return atan2(point[1] - origin[1], point[0] - origin[0])


def circle(target: Array, own: Array, radius: float, height: float) -> Array:
    """x̌ = x_P + [d cos ψ, d sin ψ, h] with ψ the bearing of the robot *from the target* (Sec. III-A), ENU
    (3,)."""
    psi = bearing(target, own)
    return np.array([target[0] + radius * cos(psi), target[1] + radius * sin(psi), target[2] + height])


def circle_error(target: Array, own: Array, radius: float, height: float) -> Array:
    """Distances (…,) in m of positions ``own`` (…, 3) from the circle around ``target`` (…, 3).

    This is what stand-off error means in reports.
    """
    offset = own - target
    across = np.hypot(offset[..., 0], offset[..., 1]) - radius
    distance: Array = np.hypot(across, offset[..., 2] - height)
    return distance
