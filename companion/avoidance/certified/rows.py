"""Rows of the certified QP: limits, separating planes, and bounds on jerk, as far as they matter.

A row bounds c·y from below: c (3,) is ± an axis for a limit, the normal for a plane, and y one of the five
results of each step, see ``motion``. What accelerations add to a control point or velocity does not decrease
with any of them; so between two bounds of a it is least at the lower one. A row that holds there for every
axis holds for all accelerations within the bounds and is left out: most limits and half of the planes of near
neighbours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.certified.motion import write_motion
from companion.values.compiled import FLOAT, INT, VOID, array, kernel, output, part, several
from companion.values.horizon import Array

BOUND = 1e-7
"""Violation of a bound of acceleration (m/s²) for which the rows that are left out hold."""


@part
def slack_of(r: int, of: NDArray[np.int64], c: Array, low: Array, results: Array) -> float:
    """Return the slack of row ``r`` for the ``results`` of a motion."""
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
    write_motion(a, 0.0, dt, flown)
    write_motion(x_min, -BOUND, dt, lowest)
    write_motion(x_max, BOUND, dt, highest)
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
    write_motion(a, 0.0, dt, results)
    for r in range(len(low)):
        slack[r] = slack_of(r, of, c, low, results)


@kernel(VOID, array(1, INT), array(1, INT), array(2), array(3), output(3))
def write_rows(rows: NDArray[np.intp], of: NDArray[np.int64], c: Array, maps: Array, G: Array) -> None:
    """Write the given ``rows`` (R,) to ``G`` (R, 3, n).

    ``maps`` (5, n, n) map accelerations to the control points, velocities and changes of the steps.
    """
    for k in range(len(rows)):
        _write_row(rows[k], of, c, maps, G[k])
