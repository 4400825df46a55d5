"""Moving planes between a plan and boxes that stand.

For a segment of the plan let q_i be its control points, and for a unit vector c let h(c) = max c·b over all
points b of the box, which one of its eight corners attains. With c the direction for which min c·q_i − h(c)
is largest, a new plan's control point i must satisfy

    c·q_i ≥ min(c·own_i, h(c) + d),

where own_i are the control points of the committed plan. So the box lies behind the plane c·x = h(c), and the
new plan d in front of it: everywhere on the segment, because a Bézier curve lies in the hull of its control
points. This holds for any c. The best c leaves a committed plan that is d from the box all of this distance,
because two convex bodies are as far apart as some plane shows. The committed plan always satisfies its rows.

The best c is perpendicular to features that are nearest to each other: a vertex of the triangle q_i and any
of the box; an edge of the triangle and a corner or an edge of the box; the triangle and a corner. They are
tried in the frame of the box, where h(c) = Σ |c_k| half_k; the vertices first, and no others if a vertex
is nearest.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from companion.values.boxes import Boxes
from companion.values.compiled import BOOL, FLOAT, VOID, array, kernel, output, part
from companion.values.dot_product import dot
from companion.values.horizon import Array

_TINY = 1e-12


def box_planes(
    committed: Array, boxes: Boxes, distance: float, spare: float, *, upright: bool = False
) -> tuple[Array, Array, Array]:
    """Return normals (M, n, 3), and the ``least`` and ``wanted`` c·q (M, n, 3) of ``Planes``.

    They are for a plan that replaces the ``committed`` one (n, 3, 3), m, and keeps ``distance`` (m) from
    each box; ``spare`` (m) is wanted beyond it. ``upright``: heights do not count.
    """
    normals, least, wanted = np.empty((3, len(boxes.centres), len(committed), 3))
    _box_planes(np.ascontiguousarray(committed), *boxes, distance, spare, upright, normals, least, wanted)
    return normals, least, wanted


@part
def _try(c: Array, triangle: Array, half: Array, upright: bool, best: Array, furthest: float) -> float:
    """Compare the direction ``c`` (3,), of any length, with the ``best`` so far; return the larger room."""
    if upright:
        c[2] = 0.0
    norm = sqrt(dot(c, c))
    if not norm >= _TINY:
        return furthest
    c /= norm
    room = min(dot(c, triangle[0]), dot(c, triangle[1]), dot(c, triangle[2]))
    room -= abs(c[0]) * half[0] + abs(c[1]) * half[1] + abs(c[2]) * half[2]
    if room <= furthest:
        return furthest
    best[:] = c
    return float(room)


@part
def _best(triangle: Array, half: Array, upright: bool, c: Array, best: Array) -> None:
    """Write the unit vector along which ``triangle`` (3, 3) is furthest from the box to ``best`` (3,)."""
    furthest, near = -np.inf, np.inf
    for i in range(3):
        for k in range(3):
            c[k] = triangle[i, k] - min(max(triangle[i, k], -half[k]), half[k])
        near = min(near, sqrt(dot(c, c)))
        furthest = _try(c, triangle, half, upright, best, furthest)
    # No direction shows more than the distance of a vertex.
    if furthest >= near - _TINY and near > 0.0:
        return
    for k in range(3):
        for sign in (1.0, -1.0):
            c[:] = 0.0
            c[k] = sign
            furthest = _try(c, triangle, half, upright, best, furthest)
    for i in range(3):
        start, end = triangle[i], triangle[(i + 1) % 3]
        square = 0.0
        for k in range(3):
            square += (end[k] - start[k]) ** 2
        for corner in range(8):
            shadow = 0.0
            for k in range(3):
                at = half[k] if corner >> k & 1 else -half[k]
                shadow += (at - start[k]) * (end[k] - start[k])
            share = min(max(shadow / max(square, _TINY), 0.0), 1.0)
            for k in range(3):
                at = half[k] if corner >> k & 1 else -half[k]
                c[k] = start[k] + share * (end[k] - start[k]) - at
            furthest = _try(c, triangle, half, upright, best, furthest)
        for k in range(3):
            u, v = (k + 1) % 3, (k + 2) % 3
            for sign in (1.0, -1.0):
                c[k] = 0.0
                c[u] = sign * (end[v] - start[v])
                c[v] = sign * (start[u] - end[u])
                furthest = _try(c, triangle, half, upright, best, furthest)
    for sign in (1.0, -1.0):
        for k in range(3):
            u, v = (k + 1) % 3, (k + 2) % 3
            c[k] = (triangle[1, u] - triangle[0, u]) * (triangle[2, v] - triangle[0, v])
            c[k] -= (triangle[1, v] - triangle[0, v]) * (triangle[2, u] - triangle[0, u])
            c[k] *= sign
        furthest = _try(c, triangle, half, upright, best, furthest)


@kernel(VOID, array(3), array(2), array(2), array(2), FLOAT, FLOAT, BOOL, *[output(3)] * 3)
def _box_planes(
    committed: Array,
    centres: Array,
    halves: Array,
    turns: Array,
    distance: float,
    spare: float,
    upright: bool,
    normals: Array,
    least: Array,
    wanted: Array,
) -> None:
    """Write the planes of the module's docstring to the last three arrays."""
    triangle, half, c, best = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    for m in range(len(centres)):
        cos, sin = turns[m, 0], turns[m, 1]
        for k in range(3):
            half[k] = 0.0 if upright and k == 2 else halves[m, k]
        for n in range(len(committed)):
            for i in range(3):
                x, y = committed[n, i, 0] - centres[m, 0], committed[n, i, 1] - centres[m, 1]
                triangle[i, 0] = cos * x + sin * y
                triangle[i, 1] = cos * y - sin * x
                triangle[i, 2] = 0.0 if upright else committed[n, i, 2] - centres[m, 2]
            best[0], best[1], best[2] = 1.0, 0.0, 0.0
            _best(triangle, half, upright, c, best)
            normal = normals[m, n]
            normal[0] = cos * best[0] - sin * best[1]
            normal[1] = sin * best[0] + cos * best[1]
            normal[2] = best[2]
            # The support in the frame of the plan, of the normal as it is rounded there.
            support = dot(normal, centres[m])
            support += abs(cos * normal[0] + sin * normal[1]) * half[0]
            support += abs(cos * normal[1] - sin * normal[0]) * half[1] + abs(normal[2]) * half[2]
            for i in range(3):
                here = dot(normal, committed[n, i])
                least[m, n, i] = min(here, support + distance)
                wanted[m, n, i] = min(here, support + distance + spare)
