"""The active set of the certified QP: what binds at its minimiser.

``active_set`` uses the dual method of D. Goldfarb and A. Idnani ("A numerically stable dual method for
solving strictly convex quadratic programs", 1983): it begins at the minimiser without inequalities, and adds
the one that is violated most, with a step in the primal and in the dual variables; one whose multiplier falls
to zero on the way is dropped. All rows are computed from the motion at every step, which costs less than a
product with their matrix.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.certified.cholesky import solve_factored, write_factor
from companion.avoidance.certified.motion import write_motion
from companion.avoidance.certified.numbered_constraints import (
    chain_rows,
    most_violated_bound,
    most_violated_row,
    write_factors,
)
from companion.values.compiled import FLOAT, INT, array, kernel, output, part
from companion.values.dot_product import dot
from companion.values.horizon import Array

_TOLERANCE = 1e-9
"""Violation of a constraint that is accepted (m, m/s, m/s²)."""
_FLAT = 1e-11
"""Curvature z·n⁺ (see ``active_set``) below which n⁺ counts as a combination of the active normals."""
_MAX_STEPS = 200


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
    # See ``most_violated_row``.
    first, after = np.full(5 * n, -1), np.empty(rows, np.int64)
    nearest, seen = np.full(5 * n, -np.inf), np.zeros((5 * n, 3))
    steepest = chain_rows(of, c, low, first, after)
    if steepest < 0.0:
        return -1
    while True:
        write_motion(x, 0.0, dt, results)
        worst, violation = most_violated_row(
            results, of, c, low, first, after, steepest, nearest, seen, -_TOLERANCE
        )
        worst, violation = most_violated_bound(x, x_min, x_max, rows, worst, violation)
        if worst < 0:
            for k in range(count):
                for i in range(count):
                    dual_P[k * count + i] = gram[k, i]
            return count
        if count == room:
            return -1
        # The violated constraint n⁺, and H n⁺.
        y_of[count] = write_factors(worst, rows, n, of, c, c_of[count])
        y, factors = y_of[count], c_of[count]
        for axis in range(3):
            for i in range(n):
                image[axis, i] = factors[axis] * images_of[y, i]
        short = violation + _along(results_of[y], factors, start) - _along(results_of[y], factors, x)
        for k in range(count + 1):
            product = products[y_of[k], y] * dot(c_of[k], factors)
            gram[count, k] = gram[k, count] = product
        multiplier = 0.0
        while True:
            step += 1
            if step > _MAX_STEPS:
                return -1
            # Directions of the step: z = H n⁺ − H N r in x, and −r in the multipliers (N: active normals).
            for k in range(count):
                r[k] = gram[count, k]
            solve_factored(L, count, r)
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
                write_factor(gram, count - 1, count, L)
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
            write_factor(gram, dropped, count, L)
