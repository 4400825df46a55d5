"""Vectors of the QPs of the DQMPC, and what is read off their solutions: eqs. (2) and (5) to (7), (11)."""

from __future__ import annotations

from math import sqrt

import numpy as np

from companion.values.compiled import FLOAT, INT, VOID, array, kernel, output
from companion.values.horizon import Array

_LEFT = 0.1
"""Share of an axis's inputs that is left at least where the field alone is near a_total."""
_TOLERANCE = 1e-7
"""Violation of a state limit (m, m/s) that is tolerated: far below what can be measured."""


@kernel(
    VOID,
    *[array(1)] * 2,
    array(2),
    *[array(1)] * 2,
    array(2),
    *[FLOAT] * 2,
    *[array(2)] * 3,
    *[output(2)] * 7,
)
def write_vectors(
    x: Array,
    v: Array,
    f: Array,
    destination: Array,
    velocity: Array,
    u_range: Array,
    a_total: float,
    dt: float,
    pull: Array,
    lowest: Array,
    highest: Array,
    c: Array,
    x_l: Array,
    x_u: Array,
    h_l: Array,
    h_u: Array,
    far_l: Array,
    far_u: Array,
) -> None:
    """Write the vectors of ``Problem``: c of eq. (2), the bounds of a, (5), and of the states, (6) and (7).

    ``u_range`` (2, 3): least and largest input. ``pull`` (2, n) times the errors of position and velocity at
    the end is c; ``lowest`` and ``highest`` (3, 2n) are the limits of velocities and positions.
    """
    n = len(f)
    if len(x) != 3 or len(v) != 3 or len(destination) != 3 or len(velocity) != 3 or c.shape[1] != n:
        raise ValueError("x, v, destination and velocity have 3 entries, f one row per step")
    down, up = np.empty(3), np.empty(3)
    for k in range(n):
        square = 0.0
        for i in range(3):
            down[i], up[i] = abs(f[k, i]) - u_range[0, i], abs(f[k, i]) + u_range[1, i]
            reach = max(down[i], up[i])
            square += reach * reach
        # The box of the inputs is shrunk until its far corner lies in the ball ‖a‖ ≤ a_total.
        scale = min(1.0, a_total / sqrt(square))
        for i in range(3):
            far_l[i, k], far_u[i, k] = -down[i] * scale, up[i] * scale
            width = _LEFT * (u_range[1, i] - u_range[0, i]) * scale
            x_l[i, k] = min(max(f[k, i] + u_range[0, i], far_l[i, k]), far_u[i, k] - width)
            x_u[i, k] = max(min(f[k, i] + u_range[1, i], far_u[i, k]), far_l[i, k] + width)
    for i in range(3):
        off_x, off_v = x[i] + n * dt * v[i] - destination[i], v[i] - velocity[i]
        for k in range(n):
            c[i, k] = off_x * pull[0, k] + off_v * pull[1, k]
            drifted = x[i] + dt * (k + 1) * v[i]
            h_l[i, k], h_u[i, k] = lowest[i, k] - v[i], highest[i, k] - v[i]
            h_l[i, n + k], h_u[i, n + k] = lowest[i, n + k] - drifted, highest[i, n + k] - drifted


@kernel(INT, array(2), FLOAT, array(2), array(2))
def keeps_limits(x: Array, dt: float, h_l: Array, h_u: Array) -> int:
    """Return the bits of the axes whose states, with accelerations ``x`` (3, n), keep their limits."""
    n, kept = x.shape[1], 0
    for i in range(3):
        place = speed = 0.0
        keeps = True
        for k in range(n):
            place += dt * (speed + 0.5 * dt * x[i, k])
            speed += dt * x[i, k]
            keeps = keeps and speed >= h_l[i, k] - _TOLERANCE and speed <= h_u[i, k] + _TOLERANCE
            keeps = keeps and place >= h_l[i, n + k] - _TOLERANCE and place <= h_u[i, n + k] + _TOLERANCE
        kept |= keeps << i
    return kept


@kernel(VOID, array(2), INT, *[array(2)] * 4, output(2))
def clip(x: Array, kept: int, x_l: Array, x_u: Array, opened_l: Array, opened_u: Array, a: Array) -> None:
    """Write ``x`` (3, n) to ``a`` (n, 3), within its bounds (3, n): the opened ones on axes not ``kept``."""
    for i in range(3):
        low, high = (x_l, x_u) if kept >> i & 1 else (opened_l, opened_u)
        for k in range(len(a)):
            a[k, i] = min(max(x[i, k], low[i, k]), high[i, k])


@kernel(VOID, *[array(1)] * 5, *[FLOAT] * 3, output(1))
def write_gradient(
    last: Array,
    x_end: Array,
    v_end: Array,
    destination: Array,
    velocity: Array,
    dt: float,
    ratio_i: float,
    ratio_v: float,
    gradient: Array,
) -> None:
    """Write ∇J, eq. (11), divided by Ω_t, to ``gradient`` (3,); ``last`` (3,) is a(N).

    ``ratio_i`` and ``ratio_v`` are Ω_i and the Ω_t of the velocity, divided by the Ω_t of the position.
    """
    for i in range(3):
        e_x, e_v = x_end[i] - destination[i], v_end[i] - velocity[i]
        gradient[i] = 2.0 * (e_x + ratio_i * last[i] + 0.5 * dt * dt * e_x + ratio_v * dt * e_v)
