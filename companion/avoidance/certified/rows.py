"""Rows of the certified QP as kernels: limits of speed and position, and separating planes.

Row r = kind·3n + axis·n + step of the limits: the kinds are +v and −v after the step, and the control points
+q₁, −q₁, +q₂, −q₂ of its segment. The rows of plane m follow, in the order of step and control point: c·q_i,
with c the plane's normal. A segment begins at q₀ = p with velocity v; q₁ = p + ½ dt v, q₂ =
p + dt v + ½ dt² a.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.values.compiled import FLOAT, INT, VOID, array, kernel, output
from companion.values.horizon import Array


@kernel(VOID, array(1), array(1), FLOAT, array(1), array(3), array(3), output(1))
def row_bounds(
    position: Array,
    velocity: Array,
    dt: float,
    limits: Array,
    normals: Array,
    wanted: Array,
    low: Array,
) -> None:
    """Write the bounds ``low`` of the rows: ``limits`` and ``wanted`` without the motion at a = 0.

    The first control point of all is the vehicle's position, which no input changes; its rows are unbounded.
    """
    n = normals.shape[1]
    block = 3 * n
    for axis in range(3):
        p, v = position[axis], velocity[axis]
        for k in range(n):
            r = axis * n + k
            first, second = p + dt * (k + 0.5) * v, p + dt * (k + 1.0) * v
            low[r] = limits[r] - v
            low[block + r] = limits[block + r] + v
            low[2 * block + r] = limits[2 * block + r] - first
            low[3 * block + r] = limits[3 * block + r] + first
            low[4 * block + r] = limits[4 * block + r] - second
            low[5 * block + r] = limits[5 * block + r] + second
    r = 6 * block
    for m in range(len(normals)):
        for k in range(n):
            for i in range(3):
                low[r] = wanted[m, k, i]
                for axis in range(3):
                    low[r] -= normals[m, k, axis] * (position[axis] + dt * (k + 0.5 * i) * velocity[axis])
                if k == 0 and i == 0:
                    low[r] = -np.inf
                r += 1


@kernel(VOID, array(2), FLOAT, array(3), array(1), output(1))
def row_slacks(a: Array, dt: float, normals: Array, low: Array, slack: Array) -> None:
    """Write ``slack`` = G a − ``low`` of all rows for the accelerations ``a`` (n, 3), m/s²."""
    n = len(a)
    block = 3 * n
    points = np.empty((n, 3, 3))
    for axis in range(3):
        p = v = 0.0
        for k in range(n):
            points[k, 0, axis] = p
            points[k, 1, axis] = p + 0.5 * dt * v
            p += dt * v + 0.5 * dt * dt * a[k, axis]
            points[k, 2, axis] = p
            v += dt * a[k, axis]
            r = axis * n + k
            slack[r] = v - low[r]
            slack[block + r] = -v - low[block + r]
            slack[2 * block + r] = points[k, 1, axis] - low[2 * block + r]
            slack[3 * block + r] = -points[k, 1, axis] - low[3 * block + r]
            slack[4 * block + r] = p - low[4 * block + r]
            slack[5 * block + r] = -p - low[5 * block + r]
    r = 6 * block
    for m in range(len(normals)):
        for k in range(n):
            c = normals[m, k]
            for i in range(3):
                q = points[k, i]
                slack[r] = c[0] * q[0] + c[1] * q[1] + c[2] * q[2] - low[r]
                r += 1


@kernel(VOID, array(1, INT), array(2), array(3), array(3), output(2))
def row_columns(rows: NDArray[np.intp], S_v: Array, maps: Array, normals: Array, G_T: Array) -> None:
    """Write the given ``rows`` (R,) as columns to ``G_T`` (3n, R), which holds zeros.

    ``S_v`` (n, n) maps accelerations to speeds; ``maps`` (3, n, n) map them to the control points.
    """
    n = len(S_v)
    block = 3 * n
    for column in range(len(rows)):
        r = rows[column]
        if r < 6 * block:
            kind, axis, k = r // block, r % block // n, r % n
            sign = 1.0 if kind % 2 == 0 else -1.0
            for j in range(n):
                G_T[axis * n + j, column] = sign * (S_v[k, j] if kind < 2 else maps[kind // 2, k, j])
            continue
        r -= 6 * block
        m, k, i = r // block, r // 3 % n, r % 3
        for axis in range(3):
            for j in range(k + 1):
                G_T[axis * n + j, column] = normals[m, k, axis] * maps[i, k, j]
