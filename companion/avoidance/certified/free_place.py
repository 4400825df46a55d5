"""Free place next to a goal that is covered: where a vehicle rests whose goal it can never reach.

A vehicle that has said farewell stays at the end of its last plan, for ever. A goal nearer to that place than
plans keep is covered. A vehicle that aims for it all the same is pushed back without end, and turns aside
again and again. So it aims for the nearest place at the height of its goal that is free of what stays.
"""

from __future__ import annotations

import numpy as np

from companion.avoidance.certified.visibility_graph import Discs
from companion.values.horizon import Array

_ROUNDING_M = 1e-6


def covered(goal: Array, centres: Array, radii: Array) -> bool:
    """Return whether ``goal`` (2,), m, is within one of the discs: ``centres`` (M, 2), ``radii`` (M,)."""
    off = centres - goal
    return bool((np.vecdot(off, off) < radii**2).any())


def free_place(goal: Array, discs: Discs, low: Array, high: Array) -> Array | None:
    """Return the place (2,), m, nearest to ``goal`` (2,) of ``free_places``; None if there is none."""
    places = free_places(goal, discs, low, high)
    return places[0] if len(places) else None


def free_places(goal: Array, discs: Discs, low: Array, high: Array) -> Array:
    """Return places (k, 2), m, near ``goal`` (2,) that are in none of the ``discs``, the nearest first.

    These are ``goal``, those on the edge of one disc and those where two edges cross, within ``low`` and
    ``high`` (2,). None are on the edges of rectangles.
    """
    places = np.concatenate([goal[None], _outward(goal, discs), _crossings(discs)])
    inside = ((places >= low) & (places <= high)).all(axis=1)
    off = places[:, None] - discs.centres
    free = (np.vecdot(off, off) >= (discs.radii - _ROUNDING_M) ** 2).all(axis=1)
    beside = (discs.rectangles.distance(places) >= discs.rectangles.radii).all(axis=1)
    places = places[inside & free & beside]
    off = places - goal
    result: Array = places[np.argsort(np.vecdot(off, off), kind="stable")]
    return result


def _outward(goal: Array, discs: Discs) -> Array:
    """Return the point of each disc's edge nearest to ``goal``, (M, 2): east where it is the centre."""
    off = goal - discs.centres
    length = np.sqrt(np.vecdot(off, off))[:, None]
    ways = np.where(length > _ROUNDING_M, off / np.maximum(length, _ROUNDING_M), (1.0, 0.0))
    result: Array = discs.centres + discs.radii[:, None] * ways
    return result


def _crossings(discs: Discs) -> Array:
    """Return where the edges of two discs cross, (k, 2)."""
    one, two = np.triu_indices(len(discs.radii), 1)
    off = discs.centres[two] - discs.centres[one]
    distance = np.sqrt(np.vecdot(off, off))
    r, s = discs.radii[one], discs.radii[two]
    crosses = (distance < r + s) & (distance > np.abs(r - s))
    off, distance, r, s, one = off[crosses], distance[crosses], r[crosses], s[crosses], one[crosses]
    along = (distance**2 + r**2 - s**2) / (2.0 * distance)
    aside = np.sqrt(np.maximum(r**2 - along**2, 0.0))
    ways = off / distance[:, None]
    foot = discs.centres[one] + along[:, None] * ways
    across = np.stack([-ways[:, 1], ways[:, 0]], axis=1) * aside[:, None]
    return np.concatenate([foot + across, foot - across])
