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
from typing import NamedTuple

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
def _step(k: int, axis: int, p: float, v: float, a: float, dt: float, results: Array) -> tuple[float, float]:
    """Write the ``results`` of step ``k`` from ``p`` and ``v`` with ``a``; return those after it."""
    results[5 * k, axis] = p
    results[5 * k + 1, axis] = p + 0.5 * dt * v
    p += dt * v + 0.5 * dt * dt * a
    results[5 * k + 2, axis] = p
    v += dt * a
    results[5 * k + 3, axis] = v
    return p, v


@part
def _motion(a: Array, more: float, dt: float, results: Array) -> None:
    """Write the ``results`` (5n, 3) of the motion from rest at 0 with ``more`` than each of ``a``."""
    p = q = r = u = v = w = 0.0
    # The axes take turns, so that none waits for its own last step.
    for k in range(a.shape[1]):
        p, u = _step(k, 0, p, u, a[0, k] + more, dt, results)
        q, v = _step(k, 1, q, v, a[1, k] + more, dt, results)
        r, w = _step(k, 2, r, w, a[2, k] + more, dt, results)
        for axis in range(3):
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
    """Write the vector ``source`` to ``to``; an assignment of arrays compiles to ten times the code."""
    for i in range(len(source)):
        to[i] = source[i]


@part
def _along(y: Array, factors: Array, a: Array) -> float:
    """Return the sum over the axes of ``factors`` (3,) times the product of ``y`` (n,) and ``a`` (3, n)."""
    # A sum for each axis: the three do not wait for each other.
    one = two = three = 0.0
    for i in range(len(y)):
        one += y[i] * a[0, i]
        two += y[i] * a[1, i]
        three += y[i] * a[2, i]
    return float(factors[0] * one + factors[1] * two + factors[2] * three)


@part
def _finite(a: Array) -> bool:
    total = 0.0
    for axis in range(3):
        for i in range(a.shape[1]):
            total += a[axis, i]
    return bool(np.isfinite(total))


@part
def _dot(a: Array, b: Array) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@part
def _factor(M: Array, first: int, count: int, L: Array) -> None:
    """Write rows ``first`` to ``count`` of the Cholesky factor ``L`` of M, whose rows before are known.

    On its diagonal are the reciprocals: a division takes several times as long as a product.
    """
    for i in range(first, count):
        for j in range(i + 1):
            rest = M[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j] = 1.0 / sqrt(max(rest, 1e-300)) if i == j else rest * L[j, j]


@part
def _solve(L: Array, count: int, b: Array) -> None:
    """Replace the first ``count`` entries of ``b`` by the solution y of L Lᵀ y = b; ``L``: by ``_factor``."""
    for i in range(count):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] *= L[i, i]
    for i in range(count - 1, -1, -1):
        b[i] *= L[i, i]
        for k in range(i):
            b[k] -= L[i, k] * b[i]


class Effects(NamedTuple):
    """What constraints on the results y, and then on the n accelerations, do to the minimiser of one cost.

    ``of`` (6n, n): accelerations → results; ``images`` (6n, n): these times H; ``products`` (6n, 6n): the
    images times the results.
    """

    of: Array
    images: Array
    products: Array


def effects(H: Array, maps: Array) -> Effects:
    """Return the effects for ``H`` (n, n) and ``maps`` (5, n, n), see ``active_set``."""
    n = len(H)
    of = np.ascontiguousarray(np.concatenate([maps.swapaxes(0, 1).reshape(5 * n, n), np.eye(n)]))
    images: Array = np.ascontiguousarray(of @ H)
    return Effects(of, images, np.ascontiguousarray(images @ of.T))


@kernel(
    INT,
    *[array(2)] * 4,
    FLOAT,
    array(1, INT),
    array(2),
    array(1),
    *[array(2)] * 2,
    output(1, INT),
    output(3),
    *[output(1)] * 2,
)
def active_set(
    results_of: Array,
    images_of: Array,
    products: Array,
    start: Array,
    dt: float,
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

    The first three are ``Effects`` of H (n, n), the inverse of the Hessian of each axis on the space that the
    equalities leave. ``start`` (3, n): the minimiser without inequalities. ``of``, ``c``, ``low``: the rows,
    see ``rows_within``. ``x_min``, ``x_max`` (3, n): bounds. Written are, for up to C constraints, ``active``
    (C,): rows, and from their number R on the 3n lower and the 3n upper bounds; and the ``images`` H Nᵀ (C,
    3, n) of their normals N; the multipliers y minimise ½ yᵀ dual_P y + dual_cᵀ y: N H Nᵀ (C², filled from
    the beginning) and the violations (C,) at the start, negative. −1 is also the result if more bind, or
    after ``_MAX_STEPS``.
    """
    n, rows, room = start.shape[1], len(low), len(active)
    x, results = start.copy(), np.empty((5 * n, 3))
    # Of each active constraint: number of its result, and its factors of the axes.
    y_of, c_of = np.empty(room, np.int64), np.empty((room, 3))
    gram, L = np.empty((room, room)), np.empty((room, room))
    multipliers, r, z, image = np.zeros(room + 1), np.empty(room), np.empty((3, n)), np.empty((3, n))
    # Loops over all axes at once.
    flat_x, flat_z, flat_image, flat_images = x.ravel(), z.ravel(), image.ravel(), images.reshape(room, -1)
    count, step = 0, 0
    if not (_finite(start) and _finite(x_min) and _finite(x_max)):
        return -1
    # The rows of each result y follow each other: ``first`` [y], and then ``after`` of each. ``nearest`` [y]:
    # the least slack of these where y was at ``seen`` [y]; from there it falls by ``steepest`` times the way.
    first, after = np.full(5 * n, -1), np.empty(rows, np.int64)
    nearest, seen, steepest = np.full(5 * n, -np.inf), np.zeros((5 * n, 3)), 0.0
    for i in range(rows - 1, -1, -1):
        if not np.isfinite(low[i]):
            return -1
        after[i], first[of[i]] = first[of[i]], i
        steepest = max(steepest, abs(c[i, 0]), abs(c[i, 1]), abs(c[i, 2]))
    while True:
        _motion(x, 0.0, dt, results)
        worst, violation = -1, -_TOLERANCE
        for k in range(5 * n):
            way = 0.0
            for axis in range(3):
                way += abs(results[k, axis] - seen[k, axis])
            i = first[k]
            if i < 0 or nearest[k] - steepest * way >= violation:
                continue
            nearest[k] = np.inf
            for axis in range(3):
                seen[k, axis] = results[k, axis]
            while i >= 0:
                slack = _slack(i, of, c, low, results)
                nearest[k] = min(nearest[k], slack)
                if slack < violation:
                    worst, violation = i, slack
                i = after[i]
        for axis in range(3):
            # Whether any bound is violated more needs no branch for each.
            lower = upper = np.inf
            for j in range(n):
                above, below = x[axis, j] - x_min[axis, j], x_max[axis, j] - x[axis, j]
                lower = above if above < lower else lower
                upper = below if below < upper else upper
            if lower < violation or upper < violation:
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
        if count == room:
            return -1
        # The violated constraint n⁺, and H n⁺.
        y_of[count] = of[worst] if worst < rows else 5 * n + (worst - rows) % n
        for axis in range(3):
            if worst < rows:
                c_of[count, axis] = c[worst, axis]
            else:
                side = (worst - rows) // n
                c_of[count, axis] = (1.0 if side < 3 else -1.0) if side % 3 == axis else 0.0
        y, factors = y_of[count], c_of[count]
        for axis in range(3):
            for i in range(n):
                image[axis, i] = factors[axis] * images_of[y, i]
        short = violation + _along(results_of[y], factors, start) - _along(results_of[y], factors, x)
        for k in range(count + 1):
            product = products[y_of[k], y] * _dot(c_of[k], factors)
            gram[count, k] = gram[k, count] = product
        multiplier = 0.0
        while True:
            step += 1
            if step > _MAX_STEPS:
                return -1
            # Directions of the step: z = H n⁺ − H N r in x, and −r in the multipliers (N: active normals).
            for k in range(count):
                r[k] = gram[count, k]
            _solve(L, count, r)
            _copy(flat_image, flat_z)
            for k in range(count):
                for i in range(3 * n):
                    flat_z[i] -= r[k] * flat_images[k, i]
            curvature = _along(results_of[y], c_of[count], z)
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
                for i in range(3 * n):
                    flat_x[i] += length * flat_z[i]
                violation += length * curvature
            if primal <= dual:
                active[count], multipliers[count], dual_c[count] = worst, multiplier, short
                _copy(flat_image, flat_images[count])
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
            for k in range(dropped, count):
                y_of[k] = y_of[k + 1]
                for axis in range(3):
                    c_of[k, axis] = c_of[k + 1, axis]
            count -= 1
            for k in range(dropped, count):
                active[k], multipliers[k], dual_c[k] = active[k + 1], multipliers[k + 1], dual_c[k + 1]
                _copy(flat_images[k + 1], flat_images[k])
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
    for axis in range(3):
        for i in range(n):
            x[axis, i] = start[axis, i]
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
