"""Rows of the certified QP as kernels, and the active set: limits, separating planes, and bounds on jerk.

A row bounds c·y from below: c (3,) is ± an axis for a limit, the normal for a plane, and y one of five
results of each step k: number 5k + i for the control point q_i of its segment, 5k + 3 for the velocity after
it, 5k + 4 for the change a_k − a_{k−1} of the acceleration. A segment begins at q₀ = p with velocity v;
q₁ = p + ½ dt v, q₂ = p + dt v + ½ dt² a. Accelerations a (3, n) are given by axis. What they add to a control
point or velocity does not decrease with any of them; so between two bounds of a it is least at the lower one.
A row that holds there for every axis holds for all accelerations within the bounds and is left out: most
limits and half of the planes of near neighbours.

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

from companion.values.compiled import FLOAT, INT, VOID, array, kernel, output, part, several
from companion.values.horizon import Array

BOUND = 1e-7
"""Violation of a bound of acceleration (m/s²) for which the rows that are left out hold."""
_TOLERANCE = 1e-9
"""Violation of a constraint that is accepted (m, m/s, m/s²)."""
_FLAT = 1e-11
"""Curvature z·n⁺ (see ``active_set``) below which n⁺ counts as a combination of the active normals."""
_MAX_STEPS = 200
_NEGATIVE = 1e-7
"""Share of the largest multiplier (at least 1) by which another may be negative, for rounding."""


@part
def _motion(a: Array, more: float, dt: float, results: Array) -> None:
    """Write the ``results`` (5n, 3) of the motion from rest at 0 with ``more`` than each of ``a``."""
    for axis in range(3):
        p = v = 0.0
        for k in range(a.shape[1]):
            results[5 * k, axis] = p
            results[5 * k + 1, axis] = p + 0.5 * dt * v
            p += dt * v + 0.5 * dt * dt * (a[axis, k] + more)
            results[5 * k + 2, axis] = p
            v += dt * (a[axis, k] + more)
            results[5 * k + 3, axis] = v
            results[5 * k + 4, axis] = a[axis, k] - (a[axis, k - 1] if k > 0 else 0.0)


@part
def _slack(r: int, of: NDArray[np.int64], c: Array, low: Array, results: Array) -> float:
    """Return the slack of row ``r``."""
    y = results[of[r]]
    return float(c[r, 0] * y[0] + c[r, 1] * y[1] + c[r, 2] * y[2] - low[r])


@part
def _write_row(r: int, of: NDArray[np.int64], c: Array, maps: Array, row: Array) -> None:
    """Write row ``r`` of G to ``row`` (3, n)."""
    i, k = of[r] % 5, of[r] // 5
    for axis in range(3):
        for j in range(maps.shape[1]):
            row[axis, j] = c[r, axis] * maps[i, k, j]


@kernel(
    several(2, INT),
    *[array(1)] * 3,
    FLOAT,
    array(2),
    array(3),
    *[array(3)] * 2,
    array(2),
    array(1),
    *[output(2)] * 2,
    output(1, INT),
    output(2),
    output(1),
    output(1, INT),
)
def rows_within(
    position: Array,
    velocity: Array,
    before: Array,
    dt: float,
    committed: Array,
    ranges: Array,
    normals: Array,
    wanted: Array,
    a_range: Array,
    change: Array,
    x_min: Array,
    x_max: Array,
    of: NDArray[np.int64],
    c: Array,
    low: Array,
    whose: NDArray[np.int64],
) -> tuple[int, int]:
    """Write the bounds of the accelerations, and the rows that some accelerations within them violate.

    Returned are the number of rows of planes, which come first, and of all. ``position``, ``velocity`` (3,):
    the state at the beginning; ``before`` (3,): the acceleration until then; ``ranges`` (2, 2, 3): least and
    largest position and velocity; ``a_range`` (2, 3): least and largest acceleration; ``change`` (3,): its
    largest change from step to step, ∞ for any. A bound or limit that the ``committed`` accelerations (n, 3)
    violate is relaxed to what they keep. ``normals``, ``wanted`` (M, n, 3): the planes. Written are the
    bounds ``x_min``, ``x_max`` (3, n), and arrays of length R ≥ 24n + 3nM: row r is ``c``·y ≥ ``low`` with
    the result y of number ``of``; ``whose`` (≥ 3nM,) is the number m of the obstacle of a plane. No input
    changes the first control point of all; it has no rows. The change at the beginning and the one at the
    end, to rest, are bounds of the first and the last acceleration.
    """
    n = x_min.shape[1]
    a, flown = np.empty((3, n)), np.empty((5 * n, 3))
    lowest, highest = np.empty((5 * n, 3)), np.empty((5 * n, 3))
    for axis in range(3):
        for k in range(n):
            a[axis, k] = committed[k, axis]
            least, most = a_range[0, axis], a_range[1, axis]
            if k == 0:
                least, most = max(least, before[axis] - change[axis]), min(most, before[axis] + change[axis])
            if k == n - 1:
                least, most = max(least, -change[axis]), min(most, change[axis])
            x_min[axis, k] = min(least, committed[k, axis])
            x_max[axis, k] = max(most, committed[k, axis])
    _motion(a, 0.0, dt, flown)
    _motion(x_min, -BOUND, dt, lowest)
    _motion(x_max, BOUND, dt, highest)
    count = 0
    for m in range(len(normals)):
        for k in range(n):
            normal = normals[m, k]
            for i in range(3):
                y = 5 * k + i
                least, bound = 0.0, wanted[m, k, i]
                for axis in range(3):
                    free = position[axis] + dt * (k + 0.5 * i) * velocity[axis]
                    bound -= normal[axis] * free
                    least += min(normal[axis] * lowest[y, axis], normal[axis] * highest[y, axis])
                # What is not finite stays.
                if not least >= bound and y > 0:
                    of[count], low[count], whose[count] = y, bound, m
                    for axis in range(3):
                        c[count, axis] = normal[axis]
                    count += 1
    planes = count
    for y in range(1, 5 * n):
        k, i = y // 5, y % 5
        for axis in range(3):
            if i in (0, 4):
                continue
            free = velocity[axis] if i == 3 else position[axis] + dt * (k + 0.5 * i) * velocity[axis]
            above = min(ranges[i // 3, 0, axis] - free, flown[y, axis])
            below = min(free - ranges[i // 3, 1, axis], -flown[y, axis])
            for sign in (1.0, -1.0):
                bound = above if sign > 0.0 else below
                least = lowest[y, axis] if sign > 0.0 else -highest[y, axis]
                if not least >= bound:
                    of[count], low[count] = y, bound
                    c[count, 0] = c[count, 1] = c[count, 2] = 0.0
                    c[count, axis] = sign
                    count += 1
    for axis in range(3):
        if not np.isfinite(change[axis]):
            continue
        for y in range(9, 5 * n, 5):
            for sign in (1.0, -1.0):
                of[count], low[count] = y, min(-change[axis], sign * flown[y, axis])
                c[count, 0] = c[count, 1] = c[count, 2] = 0.0
                c[count, axis] = sign
                count += 1
    return planes, count


@kernel(VOID, array(2), FLOAT, array(1, INT), array(2), array(1), output(1))
def row_slacks(a: Array, dt: float, of: NDArray[np.int64], c: Array, low: Array, slack: Array) -> None:
    """Write ``slack`` = G a − ``low`` of all rows for the accelerations ``a`` (3, n), m/s²."""
    results = np.empty((5 * a.shape[1], 3))
    _motion(a, 0.0, dt, results)
    for r in range(len(low)):
        slack[r] = _slack(r, of, c, low, results)


@kernel(VOID, array(1, INT), array(1, INT), array(2), array(3), output(3))
def write_rows(rows: NDArray[np.intp], of: NDArray[np.int64], c: Array, maps: Array, G: Array) -> None:
    """Write the given ``rows`` (R,) to ``G`` (R, 3, n).

    ``maps`` (5, n, n) map accelerations to the control points, velocities and changes of the steps.
    """
    for k in range(len(rows)):
        _write_row(rows[k], of, c, maps, G[k])


@part
def _copy(source: Array, to: Array) -> None:
    """Write ``source`` (3, n) to ``to``; an assignment of arrays compiles to ten times the machine code."""
    for axis in range(3):
        for i in range(source.shape[1]):
            to[axis, i] = source[axis, i]


@part
def _finite(a: Array) -> bool:
    total = 0.0
    for axis in range(3):
        for i in range(a.shape[1]):
            total += a[axis, i]
    return bool(np.isfinite(total))


@part
def _inner(a: Array, b: Array) -> float:
    """Return the sum of products of ``a`` and ``b`` (3, n)."""
    # A sum for each axis: the three do not wait for each other.
    one = two = three = 0.0
    for i in range(a.shape[1]):
        one += a[0, i] * b[0, i]
        two += a[1, i] * b[1, i]
        three += a[2, i] * b[2, i]
    return one + two + three


@part
def _factor(M: Array, first: int, count: int, L: Array) -> None:
    """Write rows ``first`` to ``count`` of the Cholesky factor ``L`` of M, whose rows before are known."""
    for i in range(first, count):
        for j in range(i + 1):
            rest = M[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j] = sqrt(max(rest, 1e-300)) if i == j else rest / L[j, j]


@part
def _solve(L: Array, count: int, b: Array) -> None:
    """Replace the first ``count`` entries of ``b`` by the solution y of L Lᵀ y = b."""
    for i in range(count):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]
    for i in range(count - 1, -1, -1):
        b[i] /= L[i, i]
        for k in range(i):
            b[k] -= L[i, k] * b[i]


@kernel(
    INT,
    array(2),
    array(2),
    FLOAT,
    array(3),
    array(1, INT),
    array(2),
    array(1),
    *[array(2)] * 2,
    output(1, INT),
    output(3),
    *[output(1)] * 2,
)
def active_set(
    H: Array,
    start: Array,
    dt: float,
    maps: Array,
    of: NDArray[np.int64],
    c: Array,
    low: Array,
    x_min: Array,
    x_max: Array,
    active: NDArray[np.int64],
    images: Array,
    dual_P: Array,
    dual_c: Array,
) -> int:
    """Write what binds at the minimiser; return its number, or −1 without a result.

    ``start`` (3, n): the minimiser without inequalities; ``H`` (n, n): the inverse of the Hessian of each
    axis on the space that the equalities leave. ``of``, ``c``, ``low``: the rows, see ``rows_within``.
    ``x_min``, ``x_max`` (3, n): bounds. Written are, for up to C constraints, ``active`` (C,): rows, and from
    their number R on the 3n lower and the 3n upper bounds; and the ``images`` H Nᵀ (C, 3, n) of their
    normals N; the multipliers y minimise ½ yᵀ dual_P y + dual_cᵀ y: N H Nᵀ (C², filled from the beginning)
    and the violations (C,) at the start, negative. −1 is also the result if more bind, or after
    ``_MAX_STEPS``.
    """
    n, rows, room = len(H), len(low), len(active)
    x, results = start.copy(), np.empty((5 * n, 3))
    normal_of, gram, L = np.empty((room, 3, n)), np.empty((room, room)), np.empty((room, room))
    multipliers, r, z = np.zeros(room + 1), np.empty(room), np.empty((3, n))
    normal, image = np.empty((3, n)), np.empty((3, n))
    count, step = 0, 0
    if not (_finite(start) and _finite(x_min) and _finite(x_max)):
        return -1
    for i in range(rows):
        if not np.isfinite(low[i]):
            return -1
    while True:
        _motion(x, 0.0, dt, results)
        worst, violation = -1, -_TOLERANCE
        for i in range(rows):
            slack = _slack(i, of, c, low, results)
            if slack < violation:
                worst, violation = i, slack
        for axis in range(3):
            for j in range(n):
                if x[axis, j] - x_min[axis, j] < violation:
                    worst, violation = rows + axis * n + j, x[axis, j] - x_min[axis, j]
                if x_max[axis, j] - x[axis, j] < violation:
                    worst, violation = rows + (3 + axis) * n + j, x_max[axis, j] - x[axis, j]
        if worst < 0:
            for k in range(count):
                for i in range(count):
                    dual_P[k * count + i] = gram[k, i]
            return count
        # Normal n⁺ of the violated constraint, and H n⁺.
        if worst < rows:
            _write_row(worst, of, c, maps, normal)
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
        if count == room:
            return -1
        for k in range(count):
            gram[count, k] = gram[k, count] = _inner(normal_of[k], image)
        multiplier = 0.0
        while True:
            step += 1
            if step > _MAX_STEPS:
                return -1
            # Directions of the step: z = H n⁺ − H N r in x, and −r in the multipliers (N: active normals).
            for k in range(count):
                r[k] = gram[count, k]
            _solve(L, count, r)
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
                active[count], multipliers[count], dual_c[count] = worst, multiplier, short
                _copy(normal, normal_of[count])
                _copy(image, images[count])
                gram[count, count] = _inner(normal, image)
                count += 1
                _factor(gram, count - 1, count, L)
                break
            # The row and column of n⁺ move up with those after the dropped one.
            for k in range(dropped, count):
                for i in range(count + 1):
                    gram[k, i] = gram[k + 1, i]
            for k in range(dropped, count):
                for i in range(count):
                    gram[i, k] = gram[i, k + 1]
            count -= 1
            for k in range(dropped, count):
                active[k], multipliers[k], dual_c[k] = active[k + 1], multipliers[k + 1], dual_c[k + 1]
                _copy(normal_of[k + 1], normal_of[k])
                _copy(images[k + 1], images[k])
            _factor(gram, dropped, count, L)


@kernel(
    FLOAT,
    array(2),
    array(3),
    array(1),
    array(1, INT),
    FLOAT,
    array(1, INT),
    array(2),
    array(1),
    *[array(2)] * 2,
    array(1, INT),
    *[output(2)] * 2,
)
def combine(
    start: Array,
    images: Array,
    multipliers: Array,
    active: NDArray[np.int64],
    dt: float,
    of: NDArray[np.int64],
    c: Array,
    low: Array,
    x_min: Array,
    x_max: Array,
    whose: NDArray[np.int64],
    x: Array,
    forces: Array,
) -> float:
    """Write the minimiser ``x`` (3, n) for the ``multipliers`` (C,) of the ``active`` constraints.

    The first rows are those of planes, of which ``whose`` (P,) names the obstacles: ``forces`` (M, 3) of
    these are the sums of the normals times the multipliers. Returned is the largest violation of a row or
    bound (m, m/s, m/s²); ∞ if a multiplier is negative by more than rounding, as x is not the minimiser then.
    """
    n, worst, largest = start.shape[1], 0.0, 1.0
    _copy(start, x)
    for m in range(len(forces)):
        for axis in range(3):
            forces[m, axis] = 0.0
    for k in range(len(multipliers)):
        largest = max(largest, multipliers[k])
    for k in range(len(multipliers)):
        if not multipliers[k] >= -_NEGATIVE * largest:
            return np.inf
        for axis in range(3):
            for i in range(n):
                x[axis, i] += multipliers[k] * images[k, axis, i]
            if active[k] < len(whose):
                forces[whose[active[k]], axis] += max(multipliers[k], 0.0) * c[active[k], axis]
    results = np.empty((5 * n, 3))
    _motion(x, 0.0, dt, results)
    for r in range(len(low)):
        worst = max(worst, -_slack(r, of, c, low, results))
    for axis in range(3):
        for i in range(n):
            worst = max(worst, x_min[axis, i] - x[axis, i], x[axis, i] - x_max[axis, i])
    return worst
