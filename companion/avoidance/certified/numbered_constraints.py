"""Constraints of the active set by number, and which of them is violated most, as parts of kernels.

The numbers are those of the rows, and then of the 3n lower and of the 3n upper bounds of the accelerations,
axis by axis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.certified.rows import slack_of
from companion.values.compiled import part
from companion.values.horizon import Array


@part
def chain_rows(
    of: NDArray[np.int64], c: Array, low: Array, first: NDArray[np.int64], after: NDArray[np.int64]
) -> float:
    """Chain the rows of each result y: ``first`` [y], and then ``after`` of each; −1 is the end.

    ``first`` (5n,) is −1 everywhere before. Returned is the largest factor of an axis; −1 if a row is not
    finite.
    """
    steepest = 0.0
    for i in range(len(low) - 1, -1, -1):
        if not np.isfinite(low[i]):
            return -1.0
        after[i], first[of[i]] = first[of[i]], i
        steepest = max(steepest, abs(c[i, 0]), abs(c[i, 1]), abs(c[i, 2]))
    return steepest


@part
def most_violated_row(
    results: Array,
    of: NDArray[np.int64],
    c: Array,
    low: Array,
    first: NDArray[np.int64],
    after: NDArray[np.int64],
    steepest: float,
    nearest: Array,
    seen: Array,
    violation: float,
) -> tuple[int, float]:
    """Return the row that is violated most, and its slack; −1 and ``violation`` if no slack is less.

    ``first``, ``after``, ``steepest``: see ``chain_rows``. ``nearest`` (5n,) is the least slack of the rows
    of each result y when y was at ``seen`` (5n, 3); since then it fell by at most ``steepest`` times the way
    of y. Only where it may be less than the least slack found so far are the rows of y computed, and
    ``nearest`` and ``seen`` written.
    """
    worst = -1
    for k in range(len(results)):
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
            slack = slack_of(i, of, c, low, results)
            nearest[k] = min(nearest[k], slack)
            if slack < violation:
                worst, violation = i, slack
            i = after[i]
    return worst, violation


@part
def most_violated_bound(
    x: Array, x_min: Array, x_max: Array, rows: int, worst: int, violation: float
) -> tuple[int, float]:
    """Return the bound that ``x`` (3, n) violates most, and by how much, as a negative number.

    ``worst`` and ``violation`` are returned if no bound is violated more. ``rows`` is the number of rows.
    """
    n = x.shape[1]
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
    return worst, violation


@part
def write_factors(number: int, rows: int, n: int, of: NDArray[np.int64], c: Array, factors: Array) -> int:
    """Write the ``factors`` (3,) of the axes of a constraint; return the number of its result.

    The results 5n to 6n − 1 are the ``n`` accelerations. ``rows`` is the number of rows.
    """
    if number < rows:
        for axis in range(3):
            factors[axis] = c[number, axis]
        return int(of[number])
    side = (number - rows) // n
    for axis in range(3):
        factors[axis] = (1.0 if side < 3 else -1.0) if side % 3 == axis else 0.0
    return 5 * n + (number - rows) % n
