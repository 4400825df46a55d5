"""Minimiser of the certified QP from the multipliers of its active set, and its check."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.certified.motion import write_motion
from companion.avoidance.certified.rows import slack_of
from companion.values.compiled import FLOAT, INT, array, kernel, output
from companion.values.horizon import Array

_NEGATIVE = 1e-7
"""Share of the largest multiplier (at least 1) by which another may be negative, for rounding."""


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
    write_motion(x, 0.0, dt, results)
    for r in range(len(low)):
        worst = max(worst, -slack_of(r, of, c, low, results))
    for axis in range(3):
        for i in range(n):
            worst = max(worst, x_min[axis, i] - x[axis, i], x[axis, i] - x_max[axis, i])
    return worst
