"""What a picture shows at one time."""

from __future__ import annotations

from math import inf, nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Single = NDArray[np.float32]
KNOTS = 17
"""Rows of a plan at most."""


class State(NamedTuple):
    """Of one vehicle: what it does, the age (s) of what it knows of the neighbour unheard of for longest, the
    CPU time (ms) of its last plan, and how often an old plan was kept. NaN and None for what is not known."""

    mode: str = ""
    age_s: float = nan
    plan_ms: float = nan
    held: int | None = None


class Moment(NamedTuple):
    """K vehicles and M moving obstacles ``time`` s after the goal event, fleet-local ENU, SI; NaN where there
    is nothing.

    ``position`` (K, 3); ``attitude`` (K, 4): w x y z of bodies with x forward, y left, z up; ``plan``
    (K, KNOTS, 6): position and velocity at the knots, the last one repeated; ``target`` (3,); ``moving``
    (M, 3); ``states`` (K).
    """

    time: float
    stage: str
    position: Single
    attitude: Single
    plan: Single
    target: Single
    moving: Single
    states: tuple[State, ...]


class Pair(NamedTuple):
    """The two vehicles, by their index, that are nearest to each other, and their ``distance`` (m)."""

    distance: float
    one: int
    other: int


def nearest(position: Single) -> Pair:
    """Of the vehicles at ``position`` (K, 3); an infinite distance if there are no two."""
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
    """A plan's positions and velocities (n, 6) as (KNOTS, 6): what is missing at its end is its last knot."""
    result = np.empty((KNOTS, 6), dtype=np.float32)
    count = min(len(plan), KNOTS)
    result[:count] = plan[:count]
    result[count:] = plan[count - 1] if count else np.nan
    return result


NO_PLAN = padded(np.empty((0, 6)))
NO_PLAN.flags.writeable = False


_TO_ENU = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
"""Half a turn about north-east: NED to ENU, and back."""
_OF_BODY = np.array([0.0, 1.0, 0.0, 0.0])
"""Half a turn about the nose: FLU to FRD, and back."""


def enu_attitude(attitude: Array) -> Array:
    """Bodies FRD in NED as bodies FLU in ENU: quaternions (…, 4), w x y z."""
    return _product(_product(_TO_ENU, attitude), _OF_BODY)


def euler_attitude(roll: float, pitch: float, yaw: float) -> Array:
    """FLU in ENU (4,) of the angles (rad) of ATTITUDE, which are those of a FRD body in NED."""
    result = np.array([1.0, 0.0, 0.0, 0.0])
    for axis, angle in ((3, yaw), (2, pitch), (1, roll)):
        turn = np.zeros(4)
        turn[0], turn[axis] = np.cos(0.5 * angle), np.sin(0.5 * angle)
        result = _product(result, turn)
    return enu_attitude(result)


def _product(a: Array, b: Array) -> Array:
    """Hamilton's, of (…, 4)."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    parts = (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )
    return np.stack(np.broadcast_arrays(*parts), axis=-1)
