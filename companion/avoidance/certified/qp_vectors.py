"""Vectors of the certified QP: its cost, the best plan without inequalities, and the bounds of the rows."""

from __future__ import annotations

import numpy as np

from companion.values.compiled import FLOAT, VOID, array, kernel, output
from companion.values.horizon import Array


@kernel(
    VOID, *[array(1)] * 3, *[array(2)] * 3, *[array(1)] * 2, *[FLOAT] * 2, *[array(2)] * 2, FLOAT, output(2)
)
def write_cost(
    position: Array,
    velocity: Array,
    before: Array,
    places: Array,
    velocities: Array,
    field: Array,
    weights: Array,
    fields: Array,
    omega_speed: float,
    omega_jerk: float,
    S_x: Array,
    S_v: Array,
    dt: float,
    c: Array,
) -> None:
    """Write c (3, n) from a ``State`` and an ``Objective``.

    ``weights`` and ``fields`` (n,) are those of the places and of the field.
    """
    n = len(weights)
    for axis in range(3):
        for j in range(n):
            total = 0.0
            for k in range(j, n):
                off = position[axis] + dt * (k + 1.0) * velocity[axis] - places[k, axis]
                total += S_x[k, j] * (weights[k] * off - fields[k] * field[k, axis])
                total += omega_speed * S_v[k, j] * (velocity[axis] - velocities[k, axis])
            c[axis, j] = 2.0 * total
        c[axis, 0] -= 2.0 * omega_jerk * before[axis]


@kernel(VOID, array(2), array(1), array(2), array(1), output(2))
def write_start(c: Array, velocity: Array, inverse: Array, stopping: Array, start: Array) -> None:
    """Write the best plan ``start`` (3, n) without inequalities: at rest at the end."""
    n = len(stopping)
    for axis in range(3):
        for j in range(n):
            start[axis, j] = -stopping[j] * velocity[axis]
            for k in range(n):
                start[axis, j] -= inverse[j, k] * c[axis, k]


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
