"""Sharing of a surface around a target: each vehicle at its nearest point, or all spread evenly.

The paper's destination is the nearest point of the surface (Sec. III-B). Vehicles that come from one side
then have their destinations side by side, and only the field separates them. With ``spread`` the destination
is turned about the target's vertical towards even bearings: K vehicles in the order of their bearings, 2π/K
apart, all turned together so that the sum of the squares of their turns is least. The order is kept, so paths
do not cross; no message is needed except positions. A vehicle that still has to go round does so outside the
surface.
"""

from __future__ import annotations

from math import inf, pi, sin

import numpy as np

from companion.config.formation import Spread
from companion.values.horizon import Array

_ROUND, _OUTSIDE = 0.25, 2.5
"""Turn (rad) beyond which a vehicle stays outside the surface, and by how far (m) at one radian more."""
_POINT = 0.1
"""Radius (m) below which a circle has no places."""
_FURTHER = 2.0
"""Relative growth of the distance (1/rad) for a vehicle that has to go round by more than ``_ROUND``."""


def even_turn(own: Array, others: Array) -> float:
    """Return the angle (rad) from the bearing of ``own`` (3,) to its even place among ``others`` (M, 3).

    The angle is counter-clockwise from above; all arguments are offsets from the target, m.
    """
    start = np.arctan2(own[1], own[0])
    ahead = np.sort((np.arctan2(others[:, 1], others[:, 0]) - start) % (2.0 * pi))
    apart = 2.0 * pi / (len(others) + 1)
    # Bearings minus places, both counted from the own bearing: the own difference is zero.
    return float(np.sum(ahead - apart * np.arange(1, len(others) + 1)) / (len(others) + 1))


def outside(offset: Array, turn: float) -> Array:
    """Return the destination ``offset`` (3,) from the target, moved outward.

    This is for a vehicle that still has to go round by ``turn`` (rad): further out, its way does not lead
    through the places of the others.
    """
    out = min(max(abs(turn) - _ROUND, 0.0), 1.0) * _OUTSIDE
    size = float(np.hypot(offset[0], offset[1]))
    if not out or size < _OUTSIDE * 1e-3:
        return offset
    further: Array = offset * np.array([1.0 + out / size, 1.0 + out / size, 1.0])
    return further


def taking_part(config: Spread, offsets: Array, radius: float) -> Array:
    """Return those of ``offsets`` (M, 3) from the target that are near enough to take part, m.

    ``radius`` (m) is the distance of the own surface point from the target.
    """
    near: Array = offsets[np.sqrt(np.vecdot(offsets, offsets)) < config.reach * radius]
    return near


def spacing(radius: float, others: int, turn: float = 0.0) -> float:
    """Return the distance (m) of even places on a circle of ``radius`` (m) with so many ``others``.

    It is larger for a vehicle that still has to go round by ``turn`` (rad), so that it does not press in. It
    is ∞ if there are no others or no places.
    """
    if not others or radius < _POINT:
        return inf
    return 2.0 * radius * sin(pi / (others + 1)) * (1.0 + _FURTHER * max(abs(turn) - _ROUND, 0.0))
