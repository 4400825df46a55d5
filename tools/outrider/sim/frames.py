"""Conversion of rows of the compiled physics (NED, body FRD) to east-north-up with bodies forward-left-up."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from sitl.vehicle.airframe import FloatArray

_HALF = sqrt(0.5)


def swapped(vectors: FloatArray) -> FloatArray:
    """Return vectors (…, 3) in ENU for those in NED, and the other way round."""
    found: FloatArray = vectors[..., [1, 0, 2]]
    found[..., 2] *= -1.0
    return found


def forward_left_up(rates: FloatArray) -> FloatArray:
    """Return body vectors (…, 3) forward-left-up for those forward-right-down, and the other way round."""
    return np.asarray(rates * np.array([1.0, -1.0, -1.0]))


def enu_attitudes(attitudes: FloatArray) -> FloatArray:
    """Return quaternions (…, 4), w x y z, FLU to ENU, for those from FRD to NED."""
    w, x, y, z = np.moveaxis(attitudes, -1, 0)
    return _HALF * np.stack([w + z, x + y, x - y, w - z], axis=-1)


def turned_yaw(yaw: FloatArray) -> FloatArray:
    """Return yaw (rad) counter-clockwise from east for one clockwise from north, and the other way round."""
    return 0.5 * pi - yaw


def yaw_of(attitudes: FloatArray) -> FloatArray:
    """Return the yaw (…,), rad, −π to π, of quaternions (…, 4), w x y z."""
    w, x, y, z = np.moveaxis(attitudes, -1, 0)
    return np.asarray(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
