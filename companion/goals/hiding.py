"""Bearings from which an obstacle or a vehicle hides the target, and the way out of them.

An occluder is a part of a vertical cylinder between two heights. Seen from the target it covers an arc of
bearings, if the ray to the camera passes it at its height. Arcs of boxes are found by rays 2° apart. A camera
inside such an arc is turned towards the nearest bearing outside all of them, in proportion to how far that
is. This is a part of the destination's turn, not a constraint.
"""

from __future__ import annotations

from math import asin, atan2, hypot, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.config.obstacles import Post, Sphere
from companion.values.bearings import wrapped
from companion.values.boxes import Boxes
from companion.values.horizon import Array

_VEHICLE_RADIUS_M = 0.4
"""Radius of a vehicle as an occluder."""


_STEP_RAD = pi / 90.0
_BEARINGS = np.arange(-pi, pi - 0.5 * _STEP_RAD, _STEP_RAD)
"""Bearings of the rays, rad."""
_TINY = 1e-12


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


def fixed_occluder(obstacle: Sphere | Post) -> Occluder:
    """Return a configured round obstacle as an occluder."""
    radius = obstacle.radius
    if isinstance(obstacle, Sphere):
        east, north, up = obstacle.at
        return Occluder(east, north, radius, up - radius, up + radius)
    east, north = obstacle.at
    return Occluder(east, north, radius, -np.inf, obstacle.height)


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


def box_arcs(target: Array, offset: Array, boxes: Boxes, clear: float) -> list[Arc]:
    """Return the arcs that ``boxes`` hide; the other arguments are those of ``hidden_arcs``.

    A box within ``clear`` of the target hides nothing.
    """
    if not len(boxes.centres):
        return []
    hidden = np.zeros(len(_BEARINGS), dtype=bool)
    distance, height = hypot(offset[0], offset[1]), float(offset[2])
    rays = np.column_stack(
        [distance * np.cos(_BEARINGS), distance * np.sin(_BEARINGS), np.full(len(_BEARINGS), height)]
    )
    for centre, half, (cos, sin) in zip(*boxes, strict=True):
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        start, steps, wide = (target - centre) @ turn, rays @ turn, half + clear
        if (np.abs(start) <= wide).all():
            continue
        # Within the pair of faces of each axis from one share of the ray to another.
        steps = np.where(steps == 0.0, _TINY, steps)
        shares = np.stack([(-wide - start) / steps, (wide - start) / steps])
        enters, leaves = shares.min(axis=0).max(axis=1), shares.max(axis=0).min(axis=1)
        hidden |= np.maximum(enters, 0.0) <= np.minimum(leaves, 1.0)
    return _runs(hidden)


def _runs(hidden: NDArray[np.bool_]) -> list[Arc]:
    """Return the arcs of consecutive ``hidden`` ones of ``_BEARINGS``, half a step wider on both sides."""
    if hidden.all():
        return [Arc(0.0, 2.0 * pi)]
    begins = np.flatnonzero(hidden & ~np.roll(hidden, 1))
    ends = np.flatnonzero(hidden & ~np.roll(hidden, -1))
    # The run that begins last may go on at the beginning of the circle.
    ends = np.roll(ends, -1) if len(ends) and ends[0] < begins[0] else ends
    arcs = []
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        half = 0.5 * _STEP_RAD * ((end - begin) % len(hidden) + 1)
        middle = float(wrapped(np.array(_BEARINGS[begin] - 0.5 * _STEP_RAD + half)))
        arcs.append(Arc(middle, half))
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
