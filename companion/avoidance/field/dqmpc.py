"""DQMPC of the paper, eqs. (2) to (7), as three QPs of N + 1 variables each: x, y and z decouple.

Deviations from the paper. The variable is the total acceleration a = u + f, because cost and dynamics depend
on nothing else: f only shifts the bounds, a ∈ [f + u_min, f + u_max]. Gravity is absent: u is relative to
hover, and the vehicle's controller carries the weight (with g in the dynamics and |u| ≤ 2 the problem has no
solution). The vehicle's own bound, ‖u + f‖ ≤ a_total, holds for every solution, unless the bounds on jerk
contradict it: the box of a is cut to −|f_i| + u_min,i ≤ a_i ≤ |f_i| + u_max,i, scaled down until its corners
lie in that ball.

Box and speed limits have priority over the field: where the bounds shifted by f leave no input that keeps
them, these bounds are opened (``opening``). A QP that still has no solution is solved without state limits
(``solve``). With ``j_max`` the jerk is bounded, too (``jerk``).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from companion.avoidance.field.jerk import Flown, JerkRows
from companion.avoidance.field.opening import open_bounds
from companion.avoidance.field.qp_vectors import clip, keeps_limits, write_gradient, write_vectors
from companion.avoidance.reduced_qp import ReducedQp, Vectors
from companion.config.planning import CostConfig, HorizonConfig, LimitsConfig
from companion.errors import SolverError
from companion.values.horizon import Array
from companion.values.prediction import prediction


class AxisQp(NamedTuple):
    """QP of one axis: min ½ aᵀPa + cᵀa, x_l ≤ a ≤ x_u, h_l ≤ Ga ≤ h_u."""

    P: Array
    c: Array
    G: Array
    h_l: Array
    h_u: Array
    x_l: Array
    x_u: Array


class Problem(NamedTuple):
    """Vectors of the three QPs, (3, n) and (3, 2n).

    They are c, the bounds of a, and the bounds of velocities and positions 1…N + 1. ``far_l``, ``far_u`` (3,
    n): the least and the largest a that the vehicle has on that axis: −|f| + u_min and |f| + u_max, scaled to
    at most a_total in norm. ``flown``: the motion that the plan continues, where jerk is bounded.
    """

    c: Array
    x_l: Array
    x_u: Array
    h_l: Array
    h_u: Array
    far_l: Array
    far_u: Array
    flown: Flown | None = None


class Solution(NamedTuple):
    """Total ``acceleration`` a = u + f (N + 1, 3), m/s²; eq. (1) with the field.

    ``relaxed`` counts axes on which constraints had to be dropped, mostly state limits.
    """

    acceleration: Array
    relaxed: int


class _Solvers(NamedTuple):
    """Solvers for one weight Ω_t: the QPs without state limits, and those with them."""

    bounded: ReducedQp
    limited: ReducedQp


class Dqmpc:
    """Matrices and solvers for one horizon, cost and set of limits.

    ``omega_scale`` lowers Ω_t (tangential band).
    """

    def __init__(self, horizon: HorizonConfig, cost: CostConfig, limits: LimitsConfig) -> None:
        n = horizon.steps + 1
        dt = horizon.dt_us * 1e-6
        self.n, self.dt, self.cost, self.limits = n, dt, cost, limits
        self.S_v, self.S_x, _ = prediction(n, dt)
        self.G: Array = np.vstack([self.S_v, self.S_x])
        self._jerk = None if limits.j_max is None else JerkRows(n, dt, np.array(limits.j_max))
        self._u_range: Array = np.array([limits.least_u, limits.u_max])
        ones = np.ones(n)
        self._low, self._high = (
            np.hstack([np.outer(speed, ones), np.outer(place, ones)])
            for speed, place in (
                (limits.least_v, limits.box_min),
                (limits.v_max, limits.box_max),
            )
        )
        # [x − x̌, v − v̌] (3, 2) at the end for a = 0, times this, gives c for Ω_t as configured.
        weights = 2.0 * np.array([cost.omega_t_position, cost.omega_t_velocity])
        self._pull: Array = weights[:, None] * np.vstack([self.S_x[-1], self.S_v[-1]])
        self._ratio_i = cost.omega_i / cost.omega_t_position
        self._ratio_v = cost.omega_t_velocity / cost.omega_t_position
        self._solvers = lru_cache(maxsize=16)(self._build)

    def hessian(self, omega_scale: float) -> Array:
        """Return P = 2(Ω_i I + Ω_x s_x s_xᵀ + Ω_v s_v s_vᵀ), with Ω_x and Ω_v times ``omega_scale``.

        s_x and s_v (n,) map a to position and velocity at the end. PIQP works best with weights between 1e2
        and 1e3.
        """
        s_x, s_v = self.S_x[-1], self.S_v[-1]
        w = self.cost
        return 2.0 * (
            w.omega_i * np.eye(self.n)
            + omega_scale
            * (w.omega_t_position * np.outer(s_x, s_x) + w.omega_t_velocity * np.outer(s_v, s_v))
        )

    def problem(
        self,
        x: Array,
        v: Array,
        f: Array,
        destination: Array,
        velocity: Array,
        omega_scale: float,
        flown: Flown | None = None,
    ) -> Problem:
        """Return the vectors of the QPs from the state and the field.

        The state is ``x``, ``v`` (3,), the field ``f`` (N + 1, 3), the destination x̌ (3,) and the terminal
        ``velocity`` (3,). ``flown`` counts where jerk is bounded; without it the plan starts from zero
        acceleration.
        """
        if self._jerk is not None and flown is None:
            flown = Flown(np.zeros(3), self.dt)
        n = self.n
        found = Problem(
            np.empty((3, n)),
            np.empty((3, n)),
            np.empty((3, n)),
            np.empty((3, 2 * n)),
            np.empty((3, 2 * n)),
            np.empty((3, n)),
            np.empty((3, n)),
            flown,
        )
        write_vectors(
            x,
            v,
            np.ascontiguousarray(f),
            destination,
            velocity,
            self._u_range,
            self.limits.a_total,
            self.dt,
            omega_scale * self._pull,
            self._low,
            self._high,
            *found[:7],
        )
        return found

    def reachable(self, problem: Problem) -> Problem:
        """Return the problem with state limits that can be kept.

        First the bounds on a are opened for the limits, as late and as little as necessary. A limit that no
        input keeps even then is widened until some inputs keep it, with a small margin.
        """
        jerk, step, last = _NO_JERK, self.dt, _NO_JERK
        least, most = problem.far_l, problem.far_u
        if self._jerk is not None and problem.flown is not None:
            jerk, last = self._jerk.j_max, problem.flown.acceleration
            step = min(problem.flown.elapsed, self.dt)
            least, most = self._jerk.reach(problem.flown)
        opened = problem._replace(
            x_l=problem.x_l.copy(), x_u=problem.x_u.copy(), h_l=problem.h_l.copy(), h_u=problem.h_u.copy()
        )
        far = problem.far_l, problem.far_u
        open_bounds(least, most, *far, self._low, self._high, jerk, self.dt, step, last, *opened[1:5])
        return opened

    def axis(self, problem: Problem, axis: int, omega_scale: float) -> AxisQp:
        """Return the QP of one axis in full, for another solver or a KKT check."""
        problem = self.reachable(problem)
        low, high = self._rows(problem)
        return AxisQp(
            self.hessian(omega_scale),
            problem.c[axis],
            self.G if self._jerk is None else np.vstack([self.G, self._jerk.D]),
            low[axis],
            high[axis],
            problem.x_l[axis],
            problem.x_u[axis],
        )

    def solve(self, problem: Problem, omega_scale: float) -> Solution:
        """Solve the three axes, each with no more constraints than necessary.

        First with the bounds on a and on jerk, and where that solution breaks a state limit, with all
        constraints. An axis whose constraints contradict each other is solved without its state limits and
        counted. Its bounds on a and on jerk still hold; where these contradict each other, the bounds on jerk
        hold. Raises SolverError only if even that fails.
        """
        solvers = self._solvers(omega_scale)
        vectors = self._without_limits(problem)
        guess = solvers.bounded.guess(vectors, _AXES[_ALL])
        relaxed = self._whole(solvers.bounded, vectors, guess.missing, guess.x)
        kept = keeps_limits(guess.x, self.dt, problem.h_l, problem.h_u)
        broken = solvers.bounded.settle(vectors, guess, _AXES[kept])
        relaxed += self._whole(solvers.bounded, vectors, broken, guess.x)
        opened = problem
        if kept != _ALL:
            opened = self.reachable(problem)
            for i in self._within_limits(solvers.limited, opened, _AXES[_ALL - kept], guess.x):
                relaxed += 1
                broken = solvers.bounded.settle(vectors, guess, [i])
                self._whole(solvers.bounded, vectors, broken, guess.x)
        a = np.empty((self.n, 3))
        if self._jerk is None:
            # PIQP keeps bounds to 1e-8: this clips the rest.
            clip(guess.x, kept, problem.x_l, problem.x_u, opened.x_l, opened.x_u, a)
        else:
            a[:] = guess.x.T
        return Solution(a, relaxed)

    def _without_limits(self, problem: Problem) -> Vectors:
        """Return the vectors with the bounds on a and on jerk."""
        if self._jerk is None or problem.flown is None:
            return Vectors(problem.c, problem.x_l, problem.x_u, _NO_ROWS, _NO_ROWS)
        return Vectors(problem.c, problem.x_l, problem.x_u, *self._jerk.bounds(problem.flown))

    def _rows(self, problem: Problem) -> tuple[Array, Array]:
        """Return bounds (3, m) of all rows: velocities, positions and, with bounded jerk, changes of a."""
        if self._jerk is None or problem.flown is None:
            return problem.h_l, problem.h_u
        d_l, d_u = self._jerk.bounds(problem.flown)
        return np.hstack([problem.h_l, d_l]), np.hstack([problem.h_u, d_u])

    def _whole(self, qp: ReducedQp, vectors: Vectors, axes: Sequence[int], x: Array) -> int:
        """Solve whole QPs without state limits to ``x`` (3, n); return how many contradict themselves.

        In these the bounds on jerk hold, and a follows, as fast as they allow, the acceleration of the
        smallest magnitude within the bounds on a.
        """
        failed = 0
        for i in axes:
            try:
                x[i] = qp.solve_whole(vectors, i)
            except SolverError:
                if self._jerk is None:
                    raise
                low, high = vectors.x_l[i], vectors.x_u[i]
                middle = np.minimum(np.maximum(0.0, low), high)
                x[i] = self._jerk.limited(middle, vectors.h_l[i], vectors.h_u[i])
                failed += 1
        return failed

    def _within_limits(self, qp: ReducedQp, opened: Problem, axes: Sequence[int], x: Array) -> list[int]:
        """Solve QPs with state limits to ``x`` (3, n); return the axes that have no solution."""
        vectors = Vectors(opened.c, opened.x_l, opened.x_u, *self._rows(opened))
        guess = qp.guess(vectors, axes)
        broken = qp.settle(vectors, guess, axes)
        failed = []
        for i in axes:
            try:
                x[i] = qp.solve_whole(vectors, i) if i in broken or i in guess.missing else guess.x[i]
            except SolverError:
                failed.append(i)
        return failed

    def gradient(self, a: Array, x_end: Array, v_end: Array, destination: Array, velocity: Array) -> Array:
        """Return ∇J = ∂J/∂x(N+1) + ∂J/∂u(N), eq. (11), as a vector (3,), divided by Ω_t (Sec. III-D.1).

        The paper adds a state gradient and an input gradient, which differ in size: here the state gradient
        is the one by the position alone. The division makes k_s and k_tang fit any scale of the weights. The
        gradient vanishes for a plan that ends at the destination with the terminal velocity and a(N) = 0.
        """
        found = np.empty(3)
        write_gradient(
            a[-1], x_end, v_end, destination, velocity, self.dt, self._ratio_i, self._ratio_v, found
        )
        return found

    def _build(self, omega_scale: float) -> _Solvers:
        P = self.hessian(omega_scale)
        D = np.zeros((0, self.n)) if self._jerk is None else self._jerk.D
        return _Solvers(ReducedQp(P, D, 3), ReducedQp(P, np.vstack([self.G, D]), 3))


_NO_JERK = np.zeros(3)
_NO_JERK.flags.writeable = False
"""Value of the bounds on jerk if jerk is not bounded."""
_NO_ROWS = np.zeros((3, 0))
"""Bounds of the rows of QPs without rows."""
_ALL = 0b111
"""Bits of the three axes."""
_AXES = [[axis for axis in range(3) if bits >> axis & 1] for bits in range(8)]
"""Axes whose bit is set, for each number of three bits."""
