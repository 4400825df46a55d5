"""Vectors of the certified QP: its cost, and the best plan without inequalities."""

from __future__ import annotations

from companion.values.compiled import FLOAT, VOID, array, kernel, output
from companion.values.horizon import Array


@kernel(
    VOID,
    *[array(1)] * 3,
    *[array(2)] * 3,
    *[array(1)] * 2,
    *[FLOAT] * 2,
    *[array(2)] * 3,
    array(1),
    FLOAT,
    *[output(2)] * 2,
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
    inverse: Array,
    stopping: Array,
    dt: float,
    c: Array,
    start: Array,
) -> None:
    """Write c (3, n) from a ``State`` and an ``Objective``, and the best plan without inequalities.

    ``weights`` and ``fields`` (n,) are those of the places and of the field. The plan ``start`` (3, n) is at
    rest at the end.
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
        for j in range(n):
            start[axis, j] = -stopping[j] * velocity[axis]
            for k in range(n):
                start[axis, j] -= inverse[j, k] * c[axis, k]
