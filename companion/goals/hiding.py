"""Bearings from which an obstacle or a vehicle hides the target, and the way out of them.

An occluder is a part of a vertical cylinder between two heights. Seen from the target it covers an arc of
bearings, if the ray to the camera passes it at its height. A camera inside such an arc is turned towards the
nearest bearing outside all of them, in proportion to how far that is. This is a part of the destination's
turn, not a constraint.
"""

from __future__ import annotations

from math import asin, atan2, hypot, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.config.obstacles import Obstacle, Sphere
from companion.values.bearings import wrapped
from companion.values.horizon import Array

_VEHICLE_RADIUS_M = 0.4
"""Radius of a vehicle as an occluder."""


class Occluder(NamedTuple):
    """Occluder: its axis ``east``, ``north`` and ``radius``, m; it reaches from ``low`` to ``high``, m."""

    east: float
    north: float
    radius: float
    low: float
    high: float


class Arc(NamedTuple):
    """Bearings (rad) from the target that are hidden: ``middle`` ± ``half``."""

    middle: float
    half: float


def fixed_occluder(obstacle: Obstacle) -> Occluder:
    """Return a configured obstacle as an occluder."""
    radius = obstacle.radius
    if isinstance(obstacle, Sphere):
        east, north, up = obstacle.at
        return Occluder(east, north, radius, up - radius, up + radius)
    return Occluder(*obstacle.at, radius, -np.inf, obstacle.height)


def vehicle_occluder(position: Array) -> Occluder:
    """Return a vehicle at ``position`` (3,), m, as an occluder."""
    east, north, up = position.tolist()
    return Occluder(east, north, _VEHICLE_RADIUS_M, up - _VEHICLE_RADIUS_M, up + _VEHICLE_RADIUS_M)


def hidden_arcs(target: Array, offset: Array, occluders: list[Occluder], clear: float) -> list[Arc]:
    """Return the arcs hidden from a camera whose ``offset`` (3,), m, from ``target`` (3,) is turned round.

    A ray is hidden that passes an occluder at less than ``clear`` (m). An occluder beyond the camera, or
    around the target, hides nothing.
    """
    distance, height = hypot(offset[0], offset[1]), float(offset[2])
    arcs = []
    for occluder in occluders:
        east, north = occluder.east - float(target[0]), occluder.north - float(target[1])
        away, radius = hypot(east, north), occluder.radius + clear
        if not radius < away < distance - occluder.radius:
            continue
        crossing = float(target[2]) + height * away / distance
        if occluder.low - clear <= crossing <= occluder.high + clear:
            arcs.append(Arc(atan2(north, east), asin(radius / away)))
    return arcs


def way_out(bearing: float, arcs: list[Arc], *, left: bool) -> float:
    """Return the turn (rad) from ``bearing`` to the nearest one outside all ``arcs``; 0 if there is none.

    ``left``: the side (counter-clockwise) that is taken where both are equally near.
    """
    if not arcs:
        return 0.0
    middles, halves = np.array(arcs).T
    if not _inside(np.array([bearing]), middles, halves)[0]:
        return 0.0
    edges = wrapped(np.concatenate([middles + halves, middles - halves]) - bearing)
    free = edges[~_inside(bearing + edges, middles, halves)]
    if not len(free):
        return 0.0
    # Equal to a degree: of two vehicles at one bearing each takes its own side.
    sides = np.abs(free) - np.where((free > 0.0) == left, pi / 180.0, 0.0)
    return float(free[np.argmin(sides)])


def _inside(bearings: Array, middles: Array, halves: Array) -> NDArray[np.bool_]:
    """Return which ``bearings`` (n,) lie inside an arc; an edge lies outside its own."""
    off = np.abs(wrapped(bearings[:, None] - middles))
    return np.asarray((off < halves - 1e-9).any(axis=1))
