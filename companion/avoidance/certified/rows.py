"""Rows of the certified QP as kernels, and the active set: limits, separating planes, and bounds on jerk.

Row r = kind·3n + axis·n + step of the limits: the kinds are +v and −v after the step, and the control points
+q₁, −q₁, +q₂, −q₂ of its segment. The rows of plane m follow, in the order of step and control point: c·q_i,
with c the plane's normal. Where the jerk is bounded, the last 6n rows are those of a_k − a_{k−1}: first the
positive ones of each axis and step, then the negative ones; those of k = 0 are a_0. A segment begins at q₀ =
p with velocity v; q₁ = p + ½ dt v, q₂ = p + dt v + ½ dt² a. Accelerations a (3, n) are given by axis.

``active_set`` finds what binds by the dual method of D. Goldfarb and A. Idnani ("A numerically stable dual
method for solving strictly convex quadratic programs", 1983): it begins at the minimiser without
inequalities, and adds the one that is violated most, with a step in the primal and in the dual variables; one
whose multiplier falls to zero on the way is dropped. All rows are computed from the motion at every step,
which costs less than a product with their matrix; that needs the rows' parts in this file.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from companion.values.compiled import FLOAT, INT, VOID, array, kernel, output, part
from companion.values.horizon import Array

_TOLERANCE = 1e-9
"""Violation of a constraint that is accepted (m, m/s, m/s²)."""
_FLAT = 1e-11
"""Curvature z·n⁺ (see ``active_set``) below which n⁺ counts as a combination of the active normals."""
_MAX_STEPS = 200
_NEGATIVE = 1e-7
"""Share of the largest multiplier (at least 1) by which another may be negative, for rounding."""


@part
def _limit_slacks(a: Array, dt: float, low: Array, slack: Array, points: Array) -> None:
    """Write the slacks of the limits, and the control points (n, 3, 3) of the motion from rest at 0."""
    n = a.shape[1]
    block = 3 * n
    for axis in range(3):
        p = v = 0.0
        for k in range(n):
            points[k, 0, axis] = p
            points[k, 1, axis] = p + 0.5 * dt * v
            p += dt * v + 0.5 * dt * dt * a[axis, k]
            points[k, 2, axis] = p
            v += dt * a[axis, k]
            r = axis * n + k
            slack[r] = v - low[r]
            slack[block + r] = -v - low[block + r]
            slack[2 * block + r] = points[k, 1, axis] - low[2 * block + r]
            slack[3 * block + r] = -points[k, 1, axis] - low[3 * block + r]
            slack[4 * block + r] = p - low[4 * block + r]
            slack[5 * block + r] = -p - low[5 * block + r]


@part
def _slacks(a: Array, dt: float, normals: Array, low: Array, slack: Array, points: Array) -> None:
    """Write the slacks of all rows; ``points`` (n, 3, 3) is scratch memory."""
    n = a.shape[1]
    _limit_slacks(a, dt, low, slack, points)
    r = 18 * n
    for m in range(len(normals)):
        for k in range(n):
            c = normals[m, k]
            for i in range(3):
                q = points[k, i]
                slack[r] = c[0] * q[0] + c[1] * q[1] + c[2] * q[2] - low[r]
                r += 1
    if r < len(low):
        for axis in range(3):
            before = 0.0
            for k in range(n):
                change, before = a[axis, k] - before, a[axis, k]
                slack[r] = change - low[r]
                slack[r + 3 * n] = -change - low[r + 3 * n]
                r += 1


@part
def _write_row(r: int, S_v: Array, maps: Array, normals: Array, row: Array) -> None:
    """Write row ``r`` of G to ``row`` (3, n)."""
    n = len(S_v)
    row[:] = 0.0
    if r < 18 * n:
        kind, axis, k = r // (3 * n), r % (3 * n) // n, r % n
        sign = 1.0 if kind % 2 == 0 else -1.0
        for j in range(n):
            row[axis, j] = sign * (S_v[k, j] if kind < 2 else maps[kind // 2, k, j])
        return
    r -= 18 * n
    if r >= normals.size:
        r -= normals.size
        axis, k = r % (3 * n) // n, r % n
        sign = 1.0 if r < 3 * n else -1.0
        row[axis, k] = sign
        if k > 0:
            row[axis, k - 1] = -sign
        return
    m, k, i = r // (3 * n), r // 3 % n, r % 3
    for axis in range(3):
        for j in range(k + 1):
            row[axis, j] = normals[m, k, axis] * maps[i, k, j]


@kernel(VOID, array(2), FLOAT, array(3), array(1), output(1))
def row_slacks(a: Array, dt: float, normals: Array, low: Array, slack: Array) -> None:
    """Write ``slack`` = G a − ``low`` of all rows for the accelerations ``a`` (3, n), m/s²."""
    _slacks(a, dt, normals, low, slack, np.empty((a.shape[1], 3, 3)))


@kernel(VOID, array(2), FLOAT, output(1))
def relax_limits(committed: Array, dt: float, low: Array) -> None:
    """Lower the bounds ``low`` of the limits to what the ``committed`` accelerations (3, n) keep."""
    n = committed.shape[1]
    slack = np.empty(18 * n)
    _limit_slacks(committed, dt, low, slack, np.empty((n, 3, 3)))
    for r in range(18 * n):
        low[r] += min(slack[r], 0.0)


@kernel(VOID, array(1, INT), array(2), array(3), array(3), output(3))
def write_rows(rows: NDArray[np.intp], S_v: Array, maps: Array, normals: Array, G: Array) -> None:
    """Write the given ``rows`` (R,) to ``G`` (R, 3, n).

    ``S_v`` (n, n) maps accelerations to speeds; ``maps`` (3, n, n) map them to the control points.
    """
    for k in range(len(rows)):
        _write_row(rows[k], S_v, maps, normals, G[k])


@part
def _copy(source: Array, to: Array) -> None:
    """Write ``source`` (3, n) to ``to``; an assignment of arrays compiles to ten times the machine code."""
    for axis in range(3):
        for i in range(source.shape[1]):
            to[axis, i] = source[axis, i]


@part
def _inner(a: Array, b: Array) -> float:
    """Return the sum of products of ``a`` and ``b`` (3, n)."""
    total = 0.0
    for axis in range(3):
        for i in range(a.shape[1]):
            total += a[axis, i] * b[axis, i]
    return total


@part
def _solve(M: Array, count: int, b: Array, L: Array) -> None:
    """Solve M y = b by Cholesky for the first ``count`` unknowns; y replaces ``b``. ``L``: scratch memory."""
    for i in range(count):
        for j in range(i + 1):
            rest = M[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j] = sqrt(max(rest, 1e-300)) if i == j else rest / L[j, j]
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            b[i] -= L[k, i] * b[k]
        b[i] /= L[i, i]


@kernel(
    INT,
    array(2),
    array(2),
    FLOAT,
    array(2),
    array(3),
    array(3),
    array(1),
    *[array(2)] * 2,
    output(1, INT),
    output(3),
    output(2),
    output(1),
)
def active_set(
    H: Array,
    start: Array,
    dt: float,
    S_v: Array,
    maps: Array,
    normals: Array,
    low: Array,
    x_min: Array,
    x_max: Array,
    active: NDArray[np.int64],
    images: Array,
    gram: Array,
    missing: Array,
) -> int:
    """Write what binds at the minimiser; return its number, or −1 without a result.

    ``start`` (3, n): the minimiser without inequalities; ``H`` (n, n): the inverse of the Hessian of each
    axis on the space that the equalities leave. ``x_min``, ``x_max`` (3, n): bounds. Written are, for up to C
    constraints, ``active`` (C,): rows, and from their number R on the 3n lower and the 3n upper bounds; the
    ``images`` H Nᵀ (C, 3, n) of their normals N, the ``gram`` matrix N H Nᵀ (C, C), and what is ``missing``
    (C,) at the start. −1 is also the result if more bind, or after ``_MAX_STEPS``.
    """
    n, rows, room = len(H), len(low), len(active)
    x, slack, points = start.copy(), np.empty(rows), np.empty((n, 3, 3))
    normal_of, L = np.empty((room, 3, n)), np.empty((room, room))
    multipliers, r, z = np.zeros(room + 1), np.empty(room), np.empty((3, n))
    normal, image = np.empty((3, n)), np.empty((3, n))
    count, step = 0, 0
    while True:
        _slacks(x, dt, normals, low, slack, points)
        worst, violation = -1, -_TOLERANCE
        for i in range(rows):
            if not slack[i] >= violation:
                worst, violation = i, slack[i]
        for axis in range(3):
            for j in range(n):
                if x[axis, j] - x_min[axis, j] < violation:
                    worst, violation = rows + axis * n + j, x[axis, j] - x_min[axis, j]
                if x_max[axis, j] - x[axis, j] < violation:
                    worst, violation = rows + (3 + axis) * n + j, x_max[axis, j] - x[axis, j]
        if worst < 0:
            return count
        # Normal n⁺ of the violated constraint, and H n⁺.
        if worst < rows:
            _write_row(worst, S_v, maps, normals, normal)
        else:
            normal[:] = 0.0
            bound = worst - rows
            normal[bound // n % 3, bound % n] = 1.0 if bound < 3 * n else -1.0
        for axis in range(3):
            for i in range(n):
                image[axis, i] = 0.0
            for j in range(n):
                if normal[axis, j] != 0.0:
                    for i in range(n):
                        image[axis, i] += normal[axis, j] * H[j, i]
        short = violation
        for axis in range(3):
            for i in range(n):
                short += normal[axis, i] * (start[axis, i] - x[axis, i])
        multiplier = 0.0
        while True:
            step += 1
            # Not finite: the problem is not, either.
            if step > _MAX_STEPS or not np.isfinite(violation):
                return -1
            # Directions of the step: z = H n⁺ − H N r in x, and −r in the multipliers (N: active normals).
            for k in range(count):
                r[k] = _inner(normal_of[k], image)
            _solve(gram, count, r, L)
            _copy(image, z)
            for k in range(count):
                for axis in range(3):
                    for i in range(n):
                        z[axis, i] -= r[k] * images[k, axis, i]
            curvature = _inner(z, normal)
            dual, dropped = np.inf, -1
            for k in range(count):
                if r[k] > 1e-12 and multipliers[k] / r[k] < dual:
                    dual, dropped = multipliers[k] / r[k], k
            primal = -violation / curvature if curvature > _FLAT else np.inf
            length = min(dual, primal)
            if length == np.inf:
                return -1
            for k in range(count):
                multipliers[k] -= length * r[k]
            multiplier += length
            if primal < np.inf:
                for axis in range(3):
                    for i in range(n):
                        x[axis, i] += length * z[axis, i]
                violation += length * curvature
            if primal <= dual:
                if count == room:
                    return -1
                active[count], multipliers[count], missing[count] = worst, multiplier, -short
                _copy(normal, normal_of[count])
                _copy(image, images[count])
                count += 1
                for k in range(count):
                    gram[k, count - 1] = gram[count - 1, k] = _inner(normal_of[k], image)
                break
            count -= 1
            for k in range(dropped, count):
                active[k], multipliers[k], missing[k] = active[k + 1], multipliers[k + 1], missing[k + 1]
                _copy(normal_of[k + 1], normal_of[k])
                _copy(images[k + 1], images[k])
                for i in range(count + 1):
                    gram[k, i] = gram[k + 1, i]
            for k in range(dropped, count):
                for i in range(count):
                    gram[i, k] = gram[i, k + 1]


@kernel(
    FLOAT,
    array(2),
    array(3),
    array(1),
    array(1, INT),
    FLOAT,
    array(3),
    array(1),
    *[array(2)] * 2,
    output(2),
    output(1),
)
def combine(
    start: Array,
    images: Array,
    multipliers: Array,
    active: NDArray[np.int64],
    dt: float,
    normals: Array,
    low: Array,
    x_min: Array,
    x_max: Array,
    x: Array,
    of_rows: Array,
) -> float:
    """Write the minimiser ``x`` (3, n) for the ``multipliers`` (C,) of the ``active`` constraints.

    Those of the rows go to ``of_rows`` (R,), which holds zeros. Returned is the largest violation of a row or
    bound (m, m/s, m/s²); ∞ if a multiplier is negative by more than rounding, as x is not the minimiser then.
    """
    n, rows, worst, largest = start.shape[1], len(low), 0.0, 1.0
    x[:] = start
    for k in range(len(multipliers)):
        largest = max(largest, multipliers[k])
    for k in range(len(multipliers)):
        if not multipliers[k] >= -_NEGATIVE * largest:
            return np.inf
        for axis in range(3):
            for i in range(n):
                x[axis, i] += multipliers[k] * images[k, axis, i]
        if active[k] < rows:
            of_rows[active[k]] = max(multipliers[k], 0.0)
    slack = np.empty(rows)
    _slacks(x, dt, normals, low, slack, np.empty((n, 3, 3)))
    for r in range(rows):
        worst = max(worst, -slack[r])
    for axis in range(3):
        for i in range(n):
            worst = max(worst, x_min[axis, i] - x[axis, i], x[axis, i] - x_max[axis, i])
    return worst
