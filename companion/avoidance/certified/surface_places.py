"""Places of vehicles on a surface around a target: who is nearer to the surface takes a place first.

The destination of the paper is the point of the surface nearest to the vehicle (Sec. III-B). Vehicles that
come from one side have nearly the same one. With planes the first of them stand there, and push the others
back in the direction of their destinations: these stand in a row behind the first, and slide round the
surface slowly. So places are assigned. Each vehicle wants the point nearest to where its newest plan ends.
In the order of the distances between the two, each takes its point, or, where others have places too near,
the next free place around the vertical through the target. Each vehicle works out all places from the plans
that it has received. Two that have received other plans may take the same place: that costs time only.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.surfaces import Surface
from companion.values.bearings import wrapped
from companion.values.horizon import Array

_EQUALLY_NEAR_M = 0.25
"""Length (m) of an interval of distances from the surface within which the lower id comes first."""
_MIN_RADIUS_M = 0.1
"""Distance of a point from the vertical through the target below which it cannot be turned."""
_ROUNDING_M = 1e-6
_STEP, _MOST = 0.35, 16
"""Step between places that are tried to each side where a surface is not round, in the largest distance that
is kept, and how many there are at most.
"""


class Comer(NamedTuple):
    """Vehicle that wants a place on its ``surface``.

    ``end`` (3,): where its newest plan ends, from the target, m.
    """

    system: int
    end: Array
    surface: Surface


class Taken(NamedTuple):
    """Place that is taken, from the target, m: nobody else's place is nearer than ``reach`` (m).

    ``height``: number by which differences in height count in the distance; 0: they do not.
    """

    place: Array
    reach: float
    height: float = 1.0


def place_of(
    own: int,
    comers: list[Comer],
    taken: list[Taken],
    reach: float,
    nearest: Array,
    height: float = 1.0,
) -> Array:
    """Return the place (3,), from the target, m, of the vehicle ``own``, one of the ``comers``.

    It is ``nearest`` (3,), the point of its surface nearest to where it is now, if that is free, and
    otherwise the free place next to where its newest plan ends. ``taken``: places that are taken by others
    already. ``reach``, ``height``: those of ``Taken`` for the comers' places. Where no place is free, it is
    ``nearest`` as well. Raises SurfaceError if the function of a user's surface fails.
    """
    wanted = sorted(
        zip(comers, _points(comers), strict=True),
        key=lambda one: (_distance(one[0].end, one[1]) // _EQUALLY_NEAR_M, one[0].system),
    )
    before = next(row for row, (comer, _) in enumerate(wanted) if comer.system == own)
    if not taken and _apart([nearest, *(point for _, point in wanted[:before])], reach, height):
        return nearest
    found = list(taken)
    for comer, point in wanted[:before]:
        place = _next_free(comer.surface, point, found)
        found.append(Taken(point if place is None else place, reach, height))
    if not found or _free(nearest[None], found)[0]:
        return nearest
    comer, point = wanted[before]
    place = _next_free(comer.surface, point, found)
    return nearest if place is None else place


def _points(comers: list[Comer]) -> Sequence[Array]:
    """Return the point of its surface nearest to the end of each plan, (3,)."""
    surface = comers[0].surface
    if all(one.surface is surface for one in comers):
        return list(surface.nearest(np.array([one.end for one in comers])))
    return [one.surface.nearest(one.end) for one in comers]


def _apart(points: list[Array], reach: float, height: float) -> bool:
    """Return whether all ``points`` (3,) are ``reach`` (m) from each other."""
    scaled = np.array(points) * (1.0, 1.0, height)
    off = scaled[:, None] - scaled
    return int((np.vecdot(off, off) < reach**2).sum()) == len(points)


def _distance(one: Array, two: Array) -> float:
    off = one - two
    return float(np.sqrt(off @ off))


def _next_free(surface: Surface, point: Array, taken: list[Taken]) -> Array | None:
    """Return ``point`` (3,) of ``surface`` or the next free place around the vertical; None without one."""
    if not taken or _free(point[None], taken)[0]:
        return point
    # On a surface that is round, seen from above, the next free place is beside one that is taken.
    hidden = [_hidden(point, one) for one in taken]
    beside = wrapped(np.array([middle + half for middle, h in hidden for half in (-h, h)]))
    for turns in (beside, _even(point, taken)):
        ordered = turns[np.argsort(np.abs(turns), kind="stable")]
        places = surface.nearest(_around(point, ordered))
        free = _free(places, taken)
        if free.any():
            place: Array = places[int(free.argmax())]
            return place
    return None


def _even(point: Array, taken: list[Taken]) -> Array:
    """Return angles (n,), rad, in even steps to both sides of ``point`` (3,)."""
    step = _STEP * max(one.reach for one in taken) / max(hypot(point[0], point[1]), _MIN_RADIUS_M)
    one_side = step * np.arange(1, _MOST + 1)
    one_side = one_side[one_side <= np.pi]
    return np.concatenate([one_side, -one_side])


def _free(points: Array, taken: list[Taken]) -> NDArray[np.bool_]:
    """Return whether each of ``points`` (n, 3) is free, (n,)."""
    places = np.array([one.place for one in taken])
    heights = np.array([(1.0, 1.0, one.height) for one in taken])
    off = (points[:, None] - places) * heights
    reach = np.array([one.reach for one in taken]) - _ROUNDING_M
    return np.asarray((np.vecdot(off, off) >= reach**2).all(axis=1))


def _hidden(point: Array, taken: Taken) -> tuple[float, float]:
    """Return the angles (rad) about the vertical at which ``point`` (3,), turned, is too near.

    They are ``middle`` ± ``half``; half is 0 where no angle is.
    """
    own, other = hypot(point[0], point[1]), hypot(taken.place[0], taken.place[1])
    up = taken.height * float(taken.place[2] - point[2])
    level = taken.reach**2 - up * up
    middle = atan2(taken.place[1], taken.place[0]) - atan2(point[1], point[0])
    if own < _MIN_RADIUS_M or other < _MIN_RADIUS_M or level <= 0.0:
        return middle, 0.0
    # Law of cosines, from the target.
    cosine = (own * own + other * other - level) / (2.0 * own * other)
    half = float(np.arccos(min(max(cosine, -1.0), 1.0)))
    return middle, half


def _around(point: Array, turns: Array) -> Array:
    """Return ``point`` (3,) turned about the vertical by each of ``turns`` (n,), rad."""
    x, y, z = point.tolist()
    c, s = np.cos(turns), np.sin(turns)
    return np.stack([c * x - s * y, s * x + c * y, np.full(len(turns), z)], axis=1)
