"""Sharing of a surface around a target: each vehicle at its nearest point, or all spread evenly.

The paper's destination is the nearest point of the surface (Sec. III-B). Vehicles that come from one side
then have their destinations side by side, and only the field separates them. With ``spread`` the destination
is turned about the target's vertical towards even bearings: K vehicles in the order of their bearings, 2π/K
apart, all turned together so that the sum of the squares of their turns is least. The order is kept, so paths
do not cross; no message is needed except the shared positions and plans. A vehicle whose place is far round
the target flies there outside the surface.
"""

from __future__ import annotations

from math import inf, pi, sin

import numpy as np

from companion.config.formation import Spread
from companion.values.horizon import Array

_FAR_TURN_RAD, _MAX_OUTWARD_M = 0.25, 2.5
"""Turn above which a destination is moved outward, and the largest shift, reached at one radian more."""
_MIN_RADIUS_M = 0.1
"""Radius below which a circle is too small to be shared."""
_SPACING_PER_RAD = 2.0
"""Relative growth of the spacing (1/rad) of a vehicle that has to go round by more than ``_FAR_TURN_RAD``."""


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
    """Return the destination ``offset`` (3,) from the target, m, moved horizontally outward.

    This is for a vehicle that still has to go round by ``turn`` (rad): further out, its path does not lead
    through the places of the others. Small turns and offsets near the vertical are not moved.
    """
    shift = min(max(abs(turn) - _FAR_TURN_RAD, 0.0), 1.0) * _MAX_OUTWARD_M
    distance = float(np.hypot(offset[0], offset[1]))
    if not shift or distance < _MAX_OUTWARD_M * 1e-3:
        return offset
    further: Array = offset * np.array([1.0 + shift / distance, 1.0 + shift / distance, 1.0])
    return further


def taking_part(config: Spread, offsets: Array, radius: float) -> Array:
    """Return those of ``offsets`` (M, 3) from the target that are near enough to take part, m.

    ``radius`` (m) is the distance of the own surface point from the target.
    """
    near: Array = offsets[np.sqrt(np.vecdot(offsets, offsets)) < config.reach * radius]
    return near


def spacing(radius: float, others: int, turn: float = 0.0) -> float:
    """Return the distance (m) of even places on a circle of ``radius`` (m), shared with ``others`` vehicles.

    It is larger for a vehicle that still has to go round by ``turn`` (rad), so that this vehicle does not
    push between the others. It is ∞ if ``others`` is 0 or the circle is smaller than 0.1 m.
    """
    if not others or radius < _MIN_RADIUS_M:
        return inf
    return (
        2.0 * radius * sin(pi / (others + 1)) * (1.0 + _SPACING_PER_RAD * max(abs(turn) - _FAR_TURN_RAD, 0.0))
    )
