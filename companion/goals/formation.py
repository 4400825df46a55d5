"""How vehicles share a surface around a target: each goes to the nearest point of it, or all spread evenly.

The paper's destination is the nearest point of the surface (Sec. III-A). Vehicles that come from one side
then all have their destinations side by side, and only the field moves them apart. With ``spread`` the
destination is turned about the target's vertical towards even bearings: K vehicles in the order of their
bearings, 2π/K apart, all turned together so that the sum of the squares of their turns is least. The order is
kept, so ways do not cross; no message is needed but positions. A vehicle that still has to go round does so
outside of the surface.
"""

from __future__ import annotations

from math import inf, pi, sin

import numpy as np

from companion.config.formation import Spread
from companion.values.horizon import Array

_ROUND, _OUTSIDE = 0.25, 2.5
"""rad and m: a vehicle that has to go round by more than the first stays outside, by the second at one radian
more."""
_POINT = 0.1
"""m: a circle that is smaller has no places."""
_FURTHER = 2.0
"""1/rad: by how much further a vehicle keeps away that has to go round by more than ``_ROUND``."""


def even_turn(own: Array, others: Array) -> float:
    """The angle (rad, counter-clockwise from above) from the bearing of ``own`` (3,) to its even place among
    ``others`` (M, 3); all are offsets from the target."""
    start = np.arctan2(own[1], own[0])
    ahead = np.sort((np.arctan2(others[:, 1], others[:, 0]) - start) % (2.0 * pi))
    apart = 2.0 * pi / (len(others) + 1)
    # Their bearings less their places, both counted from the own: its own difference is zero.
    return float(np.sum(ahead - apart * np.arange(1, len(others) + 1)) / (len(others) + 1))


def outside(offset: Array, turn: float) -> Array:
    """A destination ``offset`` (3,) from the target for a vehicle that still has to go round by ``turn``
    (rad): further out, so that its way does not lead through the places of the others."""
    out = min(max(abs(turn) - _ROUND, 0.0), 1.0) * _OUTSIDE
    size = float(np.hypot(offset[0], offset[1]))
    if not out or size < _OUTSIDE * 1e-3:
        return offset
    further: Array = offset * np.array([1.0 + out / size, 1.0 + out / size, 1.0])
    return further


def taking_part(config: Spread, offsets: Array, radius: float) -> Array:
    """Those of ``offsets`` (M, 3) from the target that are near enough to a surface point ``radius`` (m) away
    from it."""
    near: Array = offsets[np.sqrt(np.vecdot(offsets, offsets)) < config.reach * radius]
    return near


def spacing(radius: float, others: int, turn: float = 0.0) -> float:
    """How far (m) even places on a circle of that ``radius`` (m) are apart, with so many ``others``; more for
    a vehicle that still has to go round by ``turn`` (rad): it does not press in. ∞ where there are none."""
    if not others or radius < _POINT:
        return inf
    return 2.0 * radius * sin(pi / (others + 1)) * (1.0 + _FURTHER * max(abs(turn) - _ROUND, 0.0))
