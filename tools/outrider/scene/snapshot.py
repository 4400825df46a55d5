"""Data of a flight at one time, as a view displays them."""

from __future__ import annotations

from math import inf, isnan, nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from outrider.scene.camera_view import NO_VIEWS

Array = NDArray[np.float64]
Single = NDArray[np.float32]
KNOTS = 17
"""Number of rows of every plan: a shorter one is filled up, a longer one is cut off."""


class State(NamedTuple):
    """State of one vehicle.

    ``mode``: phase, and whether the vehicle keeps an old plan or brakes; ``age_s``: age of the oldest data
    among its neighbours; ``plan_ms``: CPU time of its last plan; ``held``: how often an old plan was kept.
    NaN and None for unknown values.
    """

    mode: str = ""
    age_s: float = nan
    plan_ms: float = nan
    held: int | None = None


class Snapshot(NamedTuple):
    """Snapshot at ``time`` s after the goal event: K vehicles, M moving obstacles, fleet-local ENU, SI.

    Missing values are NaN. ``stage``: stage of the flight; ``position`` (K, 3); ``attitude`` (K, 4): w x y z
    of bodies with x forward, y left, z up; ``plan`` (K, KNOTS, 6): position and velocity at the knots, the
    last one repeated; ``target`` (3,); ``moving`` (M, 3); ``states`` (K,); ``views`` (K, 12): of cameras, see
    ``camera_view``, or (0, 12) without any. ``separation``: the flight's own least distance between two
    vehicles in the air (``Samples.separation``) of the last sample, infinite without such a pair; NaN where
    only reports are known.
    """

    time: float
    stage: str
    position: Single
    attitude: Single
    plan: Single
    target: Single
    moving: Single
    states: tuple[State, ...]
    views: Single = NO_VIEWS
    separation: float = nan

    def least_distance(self) -> float:
        """Return the least distance of two vehicles (m), by reported positions if nothing better is known."""
        return nearest(self.position).distance if isnan(self.separation) else self.separation


class Pair(NamedTuple):
    """The two vehicles, by index, that are nearest to each other, and their ``distance`` (m)."""

    distance: float
    one: int
    other: int


def nearest(position: Single) -> Pair:
    """Return the nearest pair of vehicles at ``position`` (K, 3).

    The distance is infinite if there are fewer than two; both indices are then 0.
    """
    count = len(position)
    if count < 2:
        return Pair(inf, 0, 0)
    off = position[:, None] - position[None]
    square = np.einsum("jki,jki->jk", off, off)
    square[~np.isfinite(square)] = np.inf
    np.fill_diagonal(square, np.inf)
    best = int(square.argmin())
    return Pair(float(np.sqrt(square.flat[best])), *divmod(best, count))


def padded(plan: Array) -> Single:
    """Return a plan's positions and velocities (n, 6) as (KNOTS, 6), filled up with the last knot."""
    result = np.empty((KNOTS, 6), dtype=np.float32)
    count = min(len(plan), KNOTS)
    result[:count] = plan[:count]
    result[count:] = plan[count - 1] if count else np.nan
    return result


NO_PLAN = padded(np.empty((0, 6)))
NO_PLAN.flags.writeable = False


_TO_ENU = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
"""Rotation by 180° about the horizontal north-east axis: NED to ENU, and back."""
_OF_BODY = np.array([0.0, 1.0, 0.0, 0.0])
"""Rotation by 180° about the body's x axis: FLU to FRD, and back."""


def enu_attitude(attitude: Array) -> Array:
    """Convert attitudes of FRD bodies in NED to FLU bodies in ENU: quaternions (…, 4), w x y z."""
    return product(product(_TO_ENU, attitude), _OF_BODY)


def euler_attitude(roll: float, pitch: float, yaw: float) -> Array:
    """Convert the angles (rad) of ATTITUDE, of FRD in NED, to the quaternion (4,) of FLU in ENU."""
    result = np.array([1.0, 0.0, 0.0, 0.0])
    for axis, angle in ((3, yaw), (2, pitch), (1, roll)):
        turn = np.zeros(4)
        turn[0], turn[axis] = np.cos(0.5 * angle), np.sin(0.5 * angle)
        result = product(result, turn)
    return enu_attitude(result)


def product(a: Array, b: Array) -> Array:
    """Return the Hamilton product of quaternions ``a`` and ``b`` (…, 4), w x y z."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    parts = (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )
    return np.stack(np.broadcast_arrays(*parts), axis=-1)
