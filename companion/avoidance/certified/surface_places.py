"""Places of vehicles on a surface around a target: the vehicle nearest to the surface takes a place first.

The destination of the paper is the point of the surface nearest to the vehicle (Sec. III-B). Vehicles that
come from one side have nearly the same one. With planes the first of them stand there, and push the others
back in the direction of their destinations: these stand in a row behind the first, and slide round the
surface slowly. So places are assigned. Each vehicle wants the point nearest to where its newest plan ends.
In the order of the distances between the two, each takes its point, or, where others have places too near,
the next free place around the vertical through the target. Places where no plan may end are not free. Each
vehicle works out all places from the plans that it has received. Two that have received other plans may take
the same place: that costs time only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2, hypot
from typing import NamedTuple, TypeAlias

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


Allowed: TypeAlias = Callable[[Array, Array], NDArray[np.bool_]]
"""Whether plans may end at each of the places (n, 3), (n,), of candidates whose plans end at (n, 3) or (3,).

All are from the target, m.
"""


class Candidate(NamedTuple):
    """Vehicle that wants a place on its ``surface``.

    ``end`` (3,): where its newest plan ends, from the target, m.
    """

    system: int
    end: Array
    surface: Surface


class Taken(NamedTuple):
    """Place that is taken, from the target, m: the places of others are at least ``reach`` (m) away.

    ``height``: number by which differences in height count in the distance; 0: they do not.
    """

    place: Array
    reach: float
    height: float = 1.0


def place_of(
    own: int,
    candidates: list[Candidate],
    taken: list[Taken],
    reach: float,
    nearest: Array,
    height: float = 1.0,
    allowed: Allowed | None = None,
) -> Array:
    """Return the place (3,), from the target, m, of the vehicle ``own``, one of the ``candidates``.

    It is ``nearest`` (3,), the point of its surface nearest to where it is now, if that is free, and
    otherwise the free place next to where its newest plan ends. ``taken``: places that are taken by others
    already. ``reach``, ``height``: those of ``Taken`` for the candidates' places. ``allowed``: which places
    may be free; None: all. Where no place is free, it is ``nearest`` as well. Raises SurfaceError if the
    function of a user's surface fails.
    """
    wanted = sorted(
        zip(candidates, _points(candidates), strict=True),
        key=lambda one: (_distance(one[0].end, one[1]) // _EQUALLY_NEAR_M, one[0].system),
    )
    before = next(row for row, (candidate, _) in enumerate(wanted) if candidate.system == own)
    first = [nearest, *(point for _, point in wanted[:before])]
    if not taken and _apart(first, reach, height):
        ends = [wanted[before][0].end, *(candidate.end for candidate, _ in wanted[:before])]
        if allowed is None or allowed(np.array(first), np.array(ends)).all():
            return nearest
    rules = _Rules(list(taken), reach, allowed)
    for candidate, point in wanted[:before]:
        place = _next_free(candidate, point, rules)
        rules.taken.append(Taken(point if place is None else place, reach, height))
    candidate, point = wanted[before]
    if _free(nearest[None], candidate, rules)[0]:
        return nearest
    place = _next_free(candidate, point, rules)
    return nearest if place is None else place


class _Rules(NamedTuple):
    """What decides whether a place is free; ``reach`` (m) of the candidates' places."""

    taken: list[Taken]
    reach: float
    allowed: Allowed | None


def _points(candidates: list[Candidate]) -> Sequence[Array]:
    """Return the point of its surface nearest to the end of each plan, (3,)."""
    surface = candidates[0].surface
    if all(one.surface is surface for one in candidates):
        return list(surface.nearest(np.array([one.end for one in candidates])))
    return [one.surface.nearest(one.end) for one in candidates]


def _apart(points: list[Array], reach: float, height: float) -> bool:
    """Return whether all ``points`` (3,) are ``reach`` (m) from each other."""
    scaled = np.array(points) * (1.0, 1.0, height)
    off = scaled[:, None] - scaled
    return int((np.vecdot(off, off) < reach**2).sum()) == len(points)


def _distance(one: Array, two: Array) -> float:
    off = one - two
    return float(np.sqrt(off @ off))


def _next_free(candidate: Candidate, point: Array, rules: _Rules) -> Array | None:
    """Return ``point`` (3,) of the surface or the next free place around the vertical; None without one."""
    if _free(point[None], candidate, rules)[0]:
        return point
    # On a surface that is round, seen from above, the next free place is beside one that is taken.
    hidden = [_hidden(point, one) for one in rules.taken]
    beside = wrapped(np.array([middle + half for middle, h in hidden for half in (-h, h)]))
    for turns in (beside, _even(point, rules)):
        if not len(turns):
            continue
        ordered = turns[np.argsort(np.abs(turns), kind="stable")]
        places = candidate.surface.nearest(_around(point, ordered))
        free = _free(places, candidate, rules)
        if free.any():
            place: Array = places[int(free.argmax())]
            return place
    return None


def _even(point: Array, rules: _Rules) -> Array:
    """Return angles (n,), rad, in even steps to both sides of ``point`` (3,)."""
    widest = max((one.reach for one in rules.taken), default=rules.reach)
    step = _STEP * widest / max(hypot(point[0], point[1]), _MIN_RADIUS_M)
    one_side = step * np.arange(1, _MOST + 1)
    one_side = one_side[one_side <= np.pi]
    return np.concatenate([one_side, -one_side])


def _free(points: Array, candidate: Candidate, rules: _Rules) -> NDArray[np.bool_]:
    """Return whether each of ``points`` (n, 3) is free for the ``candidate``, (n,)."""
    free = np.ones(len(points), dtype=np.bool_)
    if rules.taken:
        places = np.array([one.place for one in rules.taken])
        heights = np.array([(1.0, 1.0, one.height) for one in rules.taken])
        off = (points[:, None] - places) * heights
        reach = np.array([one.reach for one in rules.taken]) - _ROUNDING_M
        free = np.asarray((np.vecdot(off, off) >= reach**2).all(axis=1))
    if rules.allowed is not None and free.any():
        free &= rules.allowed(points, candidate.end)
    return free


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
