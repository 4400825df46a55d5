"""Moving planes between a vehicle and everything else.

They keep two new plans apart although each side knows only an older plan of the other. Both sides compute
them from one pair of plans, one of each. For a neighbour and a segment, r_i are the control points of the own
plan of the pair minus those of the neighbour's (the same knots, so the same index), x the point of their
triangle nearest to the origin, c = x/‖x‖. Both sides compute the same plane with opposite normals, because
floating point is symmetric under a change of sign. A new plan's control point i must satisfy

    c·q_i ≥ c·own_i − λ max(c·r_i − d, 0),     λ = (1 − c·m)/2,     m = shift (u + u')/(‖u‖ + ‖u'‖ + 1 m),

where own_i are the control points of the own plan of the pair, d is the least distance, and u and u' are what
the two plans travel from the beginning of the agreement to their ends. The neighbour's new plan must satisfy
the same from the other side, where c is −c and λ is 1 − λ. So any two new plans are min(d, c·r_i) apart along
c at every control point, hence everywhere on the segment (a Bézier curve lies in the hull of its control
points). The own plan of the pair itself satisfies it, with the room λ max(c·r_i − d, 0), as 0 < λ < 1. Planes
thus move with both vehicles: one that flies towards another which flies away has more of the room, and may
replan into what the other one leaves. For an obstacle that shares no plan the own side keeps the whole
distance, and the own plan of the pair is the committed one. ``box_planes`` has the planes of boxes.

With ``downwash`` w > 1 the distance of two vehicles is ‖S Δ‖ with S = diag(1, 1, 1/w): the construction is
that of the plans S p, and c·S q_i is (S c)·q_i, so S c is the normal of the rows. S is linear: hulls remain
hulls, and ‖S e‖ ≤ ‖e‖ for the errors that d covers.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.box_planes import box_planes
from companion.values.boxes import Boxes
from companion.values.compiled import BOOL, FLOAT, VOID, array, kernel, output, part
from companion.values.dot_product import dot
from companion.values.horizon import Array

_TINY = 1e-12
AGREED = 13
"""Length of a row of ``agreed_planes``."""
SHARE = 12
"""Index of λ in such a row."""
_TRAVEL_M = 1.0
"""Travel added to that of both plans: planes shift little between plans that hardly move."""


class Others(NamedTuple):
    """What a new plan keeps to: A agreements, M pairs of plans, and B boxes.

    The own side keeps the whole distance of a pair. ``own`` and ``controls`` (M, n, 3, 3), m: control points
    of the own plan and of the other plan of each pair, on the committed plan's knots. ``distance`` (M, n), m:
    least distance on each segment. ``heights`` (M,): 1/w, by which differences in height are multiplied;
    None: 1. ``boxes``: to keep ``from_boxes`` (m) from; None: none. ``agreed`` (A, n + 1, 13), m: rows of
    ``agreed_planes`` from the beginning of the committed plan on, of agreements, whose other side keeps its
    own share; None: none.
    """

    own: Array
    controls: Array
    distance: Array
    heights: Array | None = None
    boxes: Boxes | None = None
    from_boxes: float = 0.0
    agreed: Array | None = None


class Planes(NamedTuple):
    """Normals c (M, n, 3), or S c where heights count less, and the least c·q of control points (M, n, 3).

    Those of agreements come first, then those of the M pairs, then those of boxes.

    ``least`` is what must hold; ``wanted`` is slightly more where the committed plan allows it, so that a
    rounded plan still keeps ``least``.
    """

    normals: Array
    least: Array
    wanted: Array


def planes(committed: Array, others: Others, spare: float, *, upright: bool = False) -> Planes:
    """Return the planes for a plan that replaces the ``committed`` one (n, 3, 3), m.

    ``spare`` (m) is wanted beyond the least distance. ``upright``: heights do not count.
    """
    steps = len(committed)
    agreed = np.empty((0, steps + 1, AGREED)) if others.agreed is None else others.agreed
    found = Planes(*np.empty((3, len(agreed) + len(others.own), steps, 3)))
    # The kernel needs contiguous arrays; those of a flight are contiguous already.
    committed, own, controls, distance = map(
        np.ascontiguousarray, (committed, others.own, others.controls, others.distance)
    )
    heights = np.ones(len(own)) if others.heights is None else np.ascontiguousarray(others.heights)
    _planes(committed, agreed, own, controls, distance, heights, spare, upright, *found)
    if others.boxes is None or not len(others.boxes.centres):
        return found
    of_boxes = box_planes(committed, others.boxes, others.from_boxes, spare, upright=upright)
    return Planes(*(np.concatenate(parts) for parts in zip(found, of_boxes, strict=True)))


def agreed_planes(
    own: Array,
    other: Array,
    distance: float,
    *,
    upright: bool = False,
    downwash: float = 1.0,
    shift: float = 0.0,
) -> Array:
    """Return what the planes of a pair of plans are made of, a row (13,) for each segment, m.

    ``own`` and ``other``: control points (k, 3, 3), m, on the same knots, from the beginning of the agreement
    until both rest. ``shift``: 0…0.9, of the module's docstring. A row has the normal S c; c·S own_i for the
    three control points; c·S r_i − ``distance``; where the other plan begins the segment; and λ.
    """
    found = np.empty((len(own), AGREED))
    height = 1.0 / downwash
    _agreed(np.ascontiguousarray(own), np.ascontiguousarray(other), distance, height, upright, shift, found)
    return found


def keeps(newest: Array, rows: Array) -> bool:
    """Return whether ``newest`` keeps the own side of the planes of an agreement.

    ``newest``: control points (k, 3, 3), m; ``rows`` (k, 13): of ``agreed_planes``, on the same knots.
    """
    return _keeps(np.ascontiguousarray(newest), np.ascontiguousarray(rows))


def apart(one: Array, two: Array, distance: float, *, upright: bool = False, downwash: float = 1.0) -> bool:
    """Return whether two plans, control points (n, 3, 3), m, are ``distance`` (m) apart at all times."""
    relative = one - two
    relative[..., 2] *= 1.0 / downwash
    if upright:
        relative[..., 2] = 0.0
    return bool((hull_distance(relative) >= distance).all())


def kept(planes: Planes, points: Array) -> bool:
    """Return whether control points (n, 3, 3), m, keep ``least`` of all planes.

    Its rounding is that of ``planes``: the committed plan keeps its planes exactly.
    """
    return _kept(planes.normals, planes.least, np.ascontiguousarray(points))


def nearest(triangles: Array) -> Array:
    """Return unit vectors (k, 3) from the origin towards the nearest point of each triangle (k, 3, 3).

    Of the directions of the nearest points of the edges and of the normal of the triangle's plane, it is the
    one along which the whole triangle is furthest from the origin. A triangle that contains the origin gets
    an arbitrary unit vector, because no plane separates the two.
    """
    found = np.empty((len(triangles), 3))
    _nearest_all(np.ascontiguousarray(triangles), found)
    return found


def hull_distance(triangles: Array) -> Array:
    """Return the distance (k,), m, of each triangle (k, 3, 3) from the origin; 0 if it holds the origin."""
    normals = nearest(triangles)
    result: Array = np.maximum(np.einsum("ki,kvi->kv", normals, triangles).min(axis=1), 0.0)
    return result


@part
def _nearest(triangle: Array, candidate: Array, best: Array) -> None:
    """Write ``nearest`` of one ``triangle`` (3, 3) to ``best`` (3,); ``candidate`` (3,) is scratch memory.

    The candidates are the nearest points of the three edges and the normal of the triangle's plane, all of
    unit length. A candidate that is nearly zero becomes zero: a fixed direction in its place could be chosen
    because of a rounding error, by one of the two vehicles only.
    """
    furthest = -np.inf
    best[:] = 0.0
    for which in range(4):
        start, end, after = triangle[which % 3], triangle[(which + 1) % 3], triangle[(which + 2) % 3]
        if which < 3:
            square = shadow = 0.0
            for i in range(3):
                square += (end[i] - start[i]) * (end[i] - start[i])
                shadow -= start[i] * (end[i] - start[i])
            share = min(max(shadow / max(square, _TINY), 0.0), 1.0)
            for i in range(3):
                candidate[i] = start[i] + share * (end[i] - start[i])
        else:
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                candidate[i] = (end[j] - start[j]) * (after[k] - end[k]) - (end[k] - start[k]) * (
                    after[j] - end[j]
                )
            if dot(candidate, start) < 0.0:
                for i in range(3):
                    candidate[i] = -candidate[i]
        norm = sqrt(dot(candidate, candidate))
        # Loops, because an operation on arrays of three takes several times as long.
        for i in range(3):
            candidate[i] /= norm if norm >= _TINY else np.inf
        margin = min(dot(candidate, triangle[0]), dot(candidate, triangle[1]), dot(candidate, triangle[2]))
        if margin > furthest:
            furthest = margin
            for i in range(3):
                best[i] = candidate[i]
    if best[0] == 0.0 and best[1] == 0.0 and best[2] == 0.0:
        best[0] = 1.0


@kernel(VOID, array(3), output(2))
def _nearest_all(triangles: Array, normals: Array) -> None:
    candidate = np.empty(3)
    for k in range(len(triangles)):
        _nearest(triangles[k], candidate, normals[k])


@part
def _gaps(
    own: Array,
    other: Array,
    height: float,
    upright: bool,
    relative: Array,
    candidate: Array,
    c: Array,
    gaps: Array,
) -> None:
    """Write the normal S c of a segment, and c·S r_i (3,), m; ``relative`` and ``candidate`` are scratch."""
    for i in range(3):
        for k in range(3):
            relative[i, k] = own[i, k] - other[i, k]
        relative[i, 2] *= height
        if upright:
            relative[i, 2] = 0.0
    _nearest(relative, candidate, c)
    for i in range(3):
        gaps[i] = dot(c, relative[i])
    c[2] *= height


@part
def _travel(plan: Array, upright: bool, travel: Array) -> float:
    """Write how far a plan goes to ``travel`` (3,), m, and return the length of it."""
    for k in range(3):
        travel[k] = plan[len(plan) - 1, 2, k] - plan[0, 0, k]
    if upright:
        travel[2] = 0.0
    return sqrt(dot(travel, travel))


@kernel(VOID, array(3), array(3), FLOAT, FLOAT, BOOL, FLOAT, output(2))
def _agreed(
    own: Array, other: Array, distance: float, height: float, upright: bool, shift: float, found: Array
) -> None:
    """Write the rows of ``agreed_planes``."""
    relative, candidate, motion, others = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    # Both sides add the same two numbers first, so their results are the same bits.
    travelled = _travel(own, upright, motion) + _travel(other, upright, others)
    for k in range(3):
        motion[k] = shift * (motion[k] + others[k]) / (travelled + _TRAVEL_M)
    for n in range(len(own)):
        row = found[n]
        c, gaps = row[:3], row[6:9]
        _gaps(own[n], other[n], height, upright, relative, candidate, c, gaps)
        for i in range(3):
            row[3 + i] = dot(c, own[n, i])
            gaps[i] -= distance
            row[9 + i] = other[n, 0, i]
        row[SHARE] = 0.5 - 0.5 * dot(c, motion)


@part
def _bounds(
    normal: Array, here: float, gap: float, share: float, spare: float, point: Array
) -> tuple[float, float]:
    """Return the least c·q of a control point, and the one that is wanted; ``point``: the committed one."""
    least = here - share * max(gap, 0.0)
    spared = here - share * max(gap - spare, 0.0)
    return least, max(least, min(spared, dot(normal, point)))


@kernel(
    VOID,
    *[array(3)] * 2,
    *[array(4)] * 2,
    array(2),
    array(1),
    FLOAT,
    BOOL,
    *[output(3)] * 3,
)
def _planes(
    committed: Array,
    agreed: Array,
    own: Array,
    controls: Array,
    distance: Array,
    heights: Array,
    spare: float,
    upright: bool,
    normals: Array,
    least: Array,
    wanted: Array,
) -> None:
    """Write the planes of the module's docstring to the last three arrays."""
    for m in range(len(agreed)):
        for n in range(len(committed)):
            row, c = agreed[m, n], normals[m, n]
            for i in range(3):
                c[i] = row[i]
            for i in range(3):
                least[m, n, i], wanted[m, n, i] = _bounds(
                    c, row[3 + i], row[6 + i], row[SHARE], spare, committed[n, i]
                )
    relative, candidate, gaps = np.empty((3, 3)), np.empty(3), np.empty(3)
    for k in range(len(controls)):
        m = len(agreed) + k
        for n in range(len(committed)):
            c = normals[m, n]
            _gaps(own[k, n], controls[k, n], heights[k], upright, relative, candidate, c, gaps)
            for i in range(3):
                here, gap = dot(c, own[k, n, i]), gaps[i] - distance[k, n]
                least[m, n, i], wanted[m, n, i] = _bounds(c, here, gap, 1.0, spare, committed[n, i])


@kernel(BOOL, array(3), array(3), array(3))
def _kept(normals: Array, least: Array, points: Array) -> bool:
    for m in range(len(normals)):
        for n in range(len(points)):
            for i in range(3):
                if not dot(normals[m, n], points[n, i]) >= least[m, n, i]:
                    return False
    return True


@kernel(BOOL, array(3), array(2))
def _keeps(points: Array, rows: Array) -> bool:
    for n in range(len(points)):
        row = rows[n]
        for i in range(3):
            least, _ = _bounds(row[:3], row[3 + i], row[6 + i], row[SHARE], 0.0, points[n, i])
            if not dot(row[:3], points[n, i]) >= least:
                return False
    return True
