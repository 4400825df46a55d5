"""Active set: the rows and bounds that bind at the minimiser of a strictly convex QP.

Dual method of D. Goldfarb and A. Idnani ("A numerically stable dual method for solving strictly convex
quadratic programs", 1983): it begins at the minimiser without constraints, and adds the constraint that is
violated most, one at a time, with a step in the primal and in the dual variables; a constraint whose
multiplier falls to zero on the way is dropped.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from companion.values.compiled import INT, array, kernel, output, part
from companion.values.horizon import Array

_MAX_CONSTRAINTS = 64
_MAX_STEPS = 200
_TOLERANCE = 1e-9
"""Violation of a constraint that is accepted (m, m/s, m/s²)."""
_FLAT = 1e-11
"""Curvature z·n⁺ (see ``binding_rows``) below which n⁺ counts as a combination of the active normals."""


@part
def _inner(a: Array, b: Array) -> float:
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@part
def _add_product(result: Array, x: Array, M: Array) -> None:
    """Add Mᵀ x to ``result`` (c,); ``M`` (r, c), ``x`` (r,). It has the same bits everywhere, unlike BLAS."""
    for i in range(len(x)):
        if x[i] != 0.0:
            for j in range(len(result)):
                result[j] += x[i] * M[i, j]


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


@kernel(INT, array(2), array(1), array(2), array(1), array(1), array(1), output(1, INT))
def binding_rows(
    H: Array, start: Array, G_T: Array, low: Array, x_min: Array, x_max: Array, found: NDArray[np.int64]
) -> int:
    """Write the binding rows of G x ≥ ``low`` to ``found``; return their number, or −1 without a solution.

    ``start`` (v,): the minimiser without inequalities; ``H`` (v, v): the inverse of the Hessian on the space
    that the equalities leave. ``G_T`` (v, R); ``x_min``, ``x_max`` (v,): bounds. −1 is also the result where
    more than 64 constraints bind at once, or after 200 steps.
    """
    size, rows = G_T.shape
    x, slack = start.copy(), -low
    _add_product(slack, start, G_T)
    active = np.empty(_MAX_CONSTRAINTS, np.int64)
    normals, images = np.empty((_MAX_CONSTRAINTS, size)), np.empty((_MAX_CONSTRAINTS, size))
    gram, L = np.empty((_MAX_CONSTRAINTS, _MAX_CONSTRAINTS)), np.empty((_MAX_CONSTRAINTS, _MAX_CONSTRAINTS))
    multipliers, r = np.zeros(_MAX_CONSTRAINTS), np.empty(_MAX_CONSTRAINTS)
    normal, image, z = np.empty(size), np.empty(size), np.empty(size)
    count, step = 0, 0
    while True:
        worst, violation = -1, -_TOLERANCE
        for i in range(rows):
            if slack[i] < violation:
                worst, violation = i, slack[i]
        for j in range(size):
            if x[j] - x_min[j] < violation:
                worst, violation = rows + j, x[j] - x_min[j]
            if x_max[j] - x[j] < violation:
                worst, violation = rows + size + j, x_max[j] - x[j]
        if worst < 0:
            break
        # Normal n⁺ of the violated constraint, and H n⁺.
        normal[:] = 0.0
        if worst < rows:
            normal[:] = G_T[:, worst]
        else:
            normal[(worst - rows) % size] = 1.0 if worst < rows + size else -1.0
        image[:] = 0.0
        _add_product(image, normal, H)
        multiplier = 0.0
        while True:
            step += 1
            if step > _MAX_STEPS:
                return -1
            # Directions of the step: z = H n⁺ − H N r in x, and −r in the multipliers (N: active normals).
            for k in range(count):
                r[k] = _inner(normals[k], image)
            _solve(gram, count, r, L)
            z[:] = image
            for k in range(count):
                z -= r[k] * images[k]
            curvature = _inner(z, normal)
            dual, dropped = np.inf, -1
            for k in range(count):
                if r[k] > 1e-12 and multipliers[k] / r[k] < dual:
                    dual, dropped = multipliers[k] / r[k], k
            primal = -violation / curvature if curvature > _FLAT else np.inf
            length = min(dual, primal)
            if length == np.inf:
                return -1
            multipliers[:count] -= length * r[:count]
            multiplier += length
            if primal < np.inf:
                x += length * z
                _add_product(slack, length * z, G_T)
                violation += length * curvature
            if primal <= dual:
                if count == _MAX_CONSTRAINTS:
                    return -1
                active[count], multipliers[count] = worst, multiplier
                normals[count], images[count] = normal, image
                count += 1
                for k in range(count):
                    gram[k, count - 1] = gram[count - 1, k] = _inner(normals[k], image)
                break
            count -= 1
            for k in range(dropped, count):
                active[k], multipliers[k] = active[k + 1], multipliers[k + 1]
                normals[k], images[k] = normals[k + 1], images[k + 1]
                gram[k, : count + 1] = gram[k + 1, : count + 1]
            for k in range(dropped, count):
                gram[:count, k] = gram[:count, k + 1]
    number = 0
    for k in range(count):
        if active[k] < rows:
            found[number] = active[k]
            number += 1
    return number
