"""The DQMPC of the paper, eqs. (2) to (6), as three QPs of N + 1 variables each: x, y and z decouple.

Settled against the text. The variable is the total acceleration a = u + f, because cost and dynamics see
nothing else: f only shifts the bounds, a ∈ [f + u_min, f + u_max]. Gravity is absent: u is relative to hover,
and the vehicle's controller carries the weight (with g in the dynamics and |u| ≤ 2 the problem has no
solution). The vehicle's own bound, ‖u + f‖ ≤ a_total, holds for every solution: the box is shrunk from
outside until its far corner lies in that ball. State limits that no input can keep (a large f does that) are
widened to what is reachable, so that every QP has a solution.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from companion.config import CostConfig, HorizonConfig, LimitsConfig
from companion.errors import SolverError
from companion.horizon import Array
from companion.prediction import prediction
from companion.solver import QpSolver

_WIDEN = 0.01
"""Share of the reach by which an unreachable bound is widened: an interior keeps the interior-point method
happy."""


class AxisQp(NamedTuple):
    """One axis: min ½ aᵀPa + cᵀa, x_l ≤ a ≤ x_u, h_l ≤ Ga ≤ h_u; ``G`` empty when no state limit is in
    reach."""

    P: Array
    c: Array
    G: Array
    h_l: Array
    h_u: Array
    x_l: Array
    x_u: Array


class Problem(NamedTuple):
    """The vectors of the three QPs, (3, n) and (3, 2n): c, bounds of a, bounds of velocities and positions
    1…N + 1."""

    c: Array
    x_l: Array
    x_u: Array
    h_l: Array
    h_u: Array
    constrained: tuple[bool, bool, bool]


class Solution(NamedTuple):
    """``acceleration`` a = u + f (N + 1, 3); ``relaxed`` counts axes whose state limits had to be dropped."""

    acceleration: Array
    relaxed: int


class Dqmpc:
    """Matrices and solvers for one horizon, cost and set of limits. ``omega_scale`` lowers Ω_t (tangential
    band)."""

    def __init__(self, horizon: HorizonConfig, cost: CostConfig, limits: LimitsConfig) -> None:
        n = horizon.steps + 1
        dt = horizon.dt_us * 1e-6
        self.n, self.dt, self.cost, self.limits = n, dt, cost, limits
        self.seconds = n * dt
        self.S_v, self.S_x, self._time = prediction(n, dt)
        self.G: Array = np.vstack([self.S_v, self.S_x])
        self._u = np.array(limits.u_max)[:, None]
        self._box = np.array([limits.box_min, limits.box_max])
        self._v_max = np.array(limits.v_max)[:, None]
        self._solvers = lru_cache(maxsize=16)(self._build)

    def hessian(self, omega_scale: float) -> Array:
        """P = 2(Ω_i I + Ω_x s_x s_xᵀ + Ω_v s_v s_vᵀ), divided by the largest Ω_t: PIQP likes weights near
        1e2."""
        s_x, s_v = self.S_x[-1], self.S_v[-1]
        w = self.cost
        return 2.0 * (
            w.omega_i * np.eye(self.n)
            + omega_scale
            * (w.omega_t_position * np.outer(s_x, s_x) + w.omega_t_velocity * np.outer(s_v, s_v))
        )

    def problem(
        self, x: Array, v: Array, f: Array, destination: Array, velocity: Array, omega_scale: float
    ) -> Problem:
        """The QPs' vectors from state (3,), (3,), field f (N + 1, 3), destination x̌ (3,) and terminal
        velocity (3,)."""
        limits, w = self.limits, self.cost
        fT = f.T
        reach = np.abs(fT) + self._u
        norm = np.sqrt((reach * reach).sum(axis=0))
        far = reach * np.minimum(1.0, limits.a_total / norm)
        x_l = np.maximum(fT - self._u, -far)
        x_u = np.minimum(fT + self._u, far)
        end = x + self._time[-1] * v
        scale = 2.0 * omega_scale
        c = np.multiply.outer(scale * w.omega_t_position * (end - destination), self.S_x[-1])
        c += np.multiply.outer(scale * w.omega_t_velocity * (v - velocity), self.S_v[-1])
        # Extremes of velocity and position that the bounds allow: they tell which limits matter and which
        # must give way.
        low, high = x_l @ self.G.T, x_u @ self.G.T
        free = np.empty_like(low)
        free[:, : self.n] = v[:, None]
        free[:, self.n :] = x[:, None] + np.multiply.outer(v, self._time)
        h_l = np.empty_like(low)
        h_u = np.empty_like(low)
        h_l[:, : self.n], h_u[:, : self.n] = -self._v_max, self._v_max
        h_l[:, self.n :], h_u[:, self.n :] = self._box[0][:, None], self._box[1][:, None]
        h_l -= free
        h_u -= free
        active = (low < h_l).any(axis=1) | (high > h_u).any(axis=1)
        margin = _WIDEN * (high - low)
        np.minimum(h_l, high - margin, out=h_l)
        np.maximum(h_u, low + margin, out=h_u)
        return Problem(c, x_l, x_u, h_l, h_u, (bool(active[0]), bool(active[1]), bool(active[2])))

    def axis(self, problem: Problem, axis: int, omega_scale: float) -> AxisQp:
        """One axis in full, for another solver or a KKT check."""
        rows = 2 * self.n if problem.constrained[axis] else 0
        return AxisQp(
            self.hessian(omega_scale),
            problem.c[axis],
            self.G[:rows],
            problem.h_l[axis][:rows],
            problem.h_u[axis][:rows],
            problem.x_l[axis],
            problem.x_u[axis],
        )

    def solve(self, problem: Problem, omega_scale: float) -> Solution:
        """Solve the three axes. An axis whose state limits contradict each other is solved without them and
        counted; its bounds on a always hold. SolverError only if even that fails."""
        free, limited = self._solvers(omega_scale)
        a = np.empty((self.n, 3))
        relaxed = 0
        c, x_l, x_u, h_l, h_u, constrained = problem
        for i in range(3):
            if constrained[i]:
                try:
                    a[:, i] = limited.solve(c[i], x_l[i], x_u[i], h_l[i], h_u[i])
                    continue
                except SolverError:
                    relaxed += 1
            a[:, i] = free.solve(c[i], x_l[i], x_u[i])
        # PIQP keeps bounds to 1e-8: the last digits are ours.
        np.minimum(np.maximum(a, x_l.T), x_u.T, out=a)
        return Solution(a, relaxed)

    def gradient(self, a: Array, x_end: Array, v_end: Array, destination: Array, velocity: Array) -> Array:
        """∇J = ∂J/∂x(N+1) + ∂J/∂u(N) as a vector (3,), divided by Ω_t (Sec. III-C.1).

        The paper adds a state gradient and an input gradient; both are taken in position space, and the
        division makes k_s and k_tang fit any scale of the weights. It vanishes at the destination.
        """
        w, dt = self.cost, self.dt
        ratio_v = w.omega_t_velocity / w.omega_t_position
        e_x, e_v = x_end - destination, v_end - velocity
        by_input = (w.omega_i / w.omega_t_position) * a[-1] + 0.5 * dt**2 * e_x + ratio_v * dt * e_v
        gradient: Array = 2.0 * (e_x + by_input)
        return gradient

    def _build(self, omega_scale: float) -> tuple[QpSolver, QpSolver]:
        P = self.hessian(omega_scale)
        return QpSolver(P), QpSolver(P, self.G)
