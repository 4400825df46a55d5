"""Motion of a plan: five results of each step of its accelerations, as parts of kernels.

The results y of step k have the numbers 5k + i for the control point q_i of its segment, 5k + 3 for the
velocity after it, 5k + 4 for the change a_k − a_{k−1} of the acceleration. A segment begins at q₀ = p with
velocity v; q₁ = p + ½ dt v, q₂ = p + dt v + ½ dt² a. Accelerations a (3, n) are given by axis.
"""

from __future__ import annotations

from companion.values.compiled import part
from companion.values.horizon import Array


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
def write_motion(a: Array, more: float, dt: float, results: Array) -> None:
    """Write the ``results`` (5n, 3) of the motion from rest at 0 with ``more`` than each of ``a``."""
    p = q = r = u = v = w = 0.0
    # The axes take turns, so that none waits for its own last step.
    for k in range(a.shape[1]):
        p, u = _step(k, 0, p, u, a[0, k] + more, dt, results)
        q, v = _step(k, 1, q, v, a[1, k] + more, dt, results)
        r, w = _step(k, 2, r, w, a[2, k] + more, dt, results)
        for axis in range(3):
            results[5 * k + 4, axis] = a[axis, k] - (a[axis, k - 1] if k > 0 else 0.0)
