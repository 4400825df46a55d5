"""DQMPC of the paper, eqs. (2) to (7), as three QPs of N + 1 variables each: x, y and z decouple.

Deviations from the paper. The variable is the total acceleration a = u + f, because cost and dynamics depend
on nothing else: f only shifts the bounds, a ∈ [f + u_min, f + u_max]. Gravity is absent: u is relative to
hover, and the vehicle's controller carries the weight (with g in the dynamics and |u| ≤ 2 the problem has no
solution). The vehicle's own bound, ‖u + f‖ ≤ a_total, holds for every solution: the box is shrunk from
outside until its far corner lies in that ball.

Box and speed limits have priority over the field. Where the bounds shifted by f leave no input that keeps
these limits, the bounds are opened towards what the vehicle can do: first as late in the horizon as possible,
so that a vehicle still evades with full force until it is fast enough (``_late``), and then as little as
necessary. Only a limit that even this cannot keep is widened to what is reachable, so that every QP has a
solution. With ``j_max`` the jerk is bounded, too (``jerk``).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.field.jerk import Flown, JerkRows
from companion.avoidance.solver import QpSolver
from companion.config.planning import CostConfig, HorizonConfig, LimitsConfig
from companion.errors import SolverError
from companion.values.horizon import Array
from companion.values.prediction import prediction

_TOLERANCE = 1e-7
"""Violation of a state limit (m, m/s) that is tolerated: far below what can be measured."""
_SPARE, _SLOWER, _INSIDE = 0.5, 0.02, 0.05
"""Margins where bounds yield to limits.

They are the share of the braking that is counted on, m/s below v_max, and m inside the box.
"""
_WIDEN = 0.01
"""Share of the reach by which an unreachable bound is widened: an interior-point method needs an interior."""


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

    They are c, the bounds of a, and the bounds of velocities and positions 1…N + 1. ``far`` (3, n): the
    largest |a| that the vehicle has on that axis, in either direction: |f| + u_max, scaled to a_total.
    ``flown``: the motion that the plan continues, where jerk is bounded.
    """

    c: Array
    x_l: Array
    x_u: Array
    h_l: Array
    h_u: Array
    far: Array
    flown: Flown | None = None


class Solution(NamedTuple):
    """Total ``acceleration`` a = u + f (N + 1, 3), m/s²; eq. (1) with the field.

    ``relaxed`` counts axes on which constraints had to be dropped, mostly state limits.
    """

    acceleration: Array
    relaxed: int


class _Solvers(NamedTuple):
    """Solvers for one weight Ω_t: −P⁻¹ (n, n), the QP without state limits, and the QP with them."""

    minimiser: Array
    bounded: QpSolver
    limited: QpSolver


class Dqmpc:
    """Matrices and solvers for one horizon, cost and set of limits.

    ``omega_scale`` lowers Ω_t (tangential band).
    """

    def __init__(self, horizon: HorizonConfig, cost: CostConfig, limits: LimitsConfig) -> None:
        n = horizon.steps + 1
        dt = horizon.dt_us * 1e-6
        self.n, self.dt, self.cost, self.limits = n, dt, cost, limits
        self._horizon_s = n * dt
        self.S_v, self.S_x, self._time = prediction(n, dt)
        self.G: Array = np.vstack([self.S_v, self.S_x])
        self._G_T: Array = np.ascontiguousarray(self.G.T)
        self._jerk = None if limits.j_max is None else JerkRows(n, dt, np.array(limits.j_max))
        self._u = np.array(limits.u_max)[:, None]
        ones, no = np.ones(n), np.zeros(n)
        # [v, x] (3, 2) times this gives velocities and positions 1…n without any input (3, 2n).
        self._drift: Array = np.vstack([np.hstack([ones, self._time]), np.hstack([no, ones])])
        self._low, self._high = (
            np.hstack([np.outer(speed, ones), np.outer(place, ones)])
            for speed, place in (
                (-np.array(limits.v_max), limits.box_min),
                (np.array(limits.v_max), limits.box_max),
            )
        )
        # [x − x̌, v − v̌] at the end (3, 2) times this gives c, for Ω_t as configured.
        weights = 2.0 * np.array([cost.omega_t_position, cost.omega_t_velocity])
        self._pull: Array = weights[:, None] * np.vstack([self.S_x[-1], self.S_v[-1]])
        self._solvers = lru_cache(maxsize=16)(self._build)

    def hessian(self, omega_scale: float) -> Array:
        """Return P = 2(Ω_i I + Ω_x s_x s_xᵀ + Ω_v s_v s_vᵀ), with Ω_x and Ω_v times ``omega_scale``.

        PIQP works best with weights between 1e2 and 1e3.
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
        fT = f.T
        reach = np.abs(fT) + self._u
        norm = np.sqrt((reach * reach).sum(axis=0))
        far = reach * np.minimum(1.0, self.limits.a_total / norm)
        x_l = np.maximum(fT - self._u, -far)
        x_u = np.minimum(fT + self._u, far)
        state = np.empty((3, 2))
        state[:, 0], state[:, 1] = v, x
        off = np.empty((3, 2))
        off[:, 0], off[:, 1] = x + self._horizon_s * v - destination, v - velocity
        free = state @ self._drift
        if self._jerk is not None and flown is None:
            flown = Flown(np.zeros(3), self.dt)
        return Problem(
            (omega_scale * off) @ self._pull, x_l, x_u, self._low - free, self._high - free, far, flown
        )

    def reachable(self, problem: Problem) -> Problem:
        """Return the problem with state limits that can be kept.

        First the bounds on a are opened for the limits, as late and as little as necessary. A limit that no
        input keeps even then is widened to slightly beyond what is reachable.
        """
        _, x_l, x_u, h_l, h_u, far, flown = problem
        least, most = -far, far
        if self._jerk is not None and flown is not None:
            a_l, a_u = self._jerk.reach(flown)
            x_l, x_u = np.minimum(np.maximum(x_l, a_l), a_u), np.maximum(np.minimum(x_u, a_u), a_l)
            least, most = np.minimum(np.maximum(least, a_l), a_u), np.maximum(np.minimum(most, a_u), a_l)
        least, most = np.minimum(least, x_l), np.maximum(most, x_u)
        # The state that the plan begins with, recovered from the drift in the rows.
        v = self._low[:, 0] - h_l[:, 0]
        x = self._low[:, -1] - h_l[:, -1] - self._horizon_s * v
        down = np.any(h_l > x_u @ self._G_T + _TOLERANCE, axis=1, keepdims=True)
        if down.any():
            late = -self._late(-x_u, -most, x - self._low[:, -1], -v, flown, -1.0)
            x_u = np.where(down, np.maximum(x_u, late), x_u)
        up = np.any(x_l @ self._G_T > h_u + _TOLERANCE, axis=1, keepdims=True)
        if up.any():
            late = self._late(x_l, least, self._high[:, -1] - x, v, flown, 1.0)
            x_l = np.where(up, np.minimum(x_l, late), x_l)
        margin = _WIDEN * ((most - least) @ self._G_T)
        x_u = x_u + self._opened(h_l - x_u @ self._G_T, most - x_u, margin)
        x_l = x_l - self._opened(x_l @ self._G_T - h_u, x_l - least, margin)
        low, high = x_l @ self._G_T, x_u @ self._G_T
        margin = _WIDEN * (high - low)
        return problem._replace(
            x_l=np.minimum(x_l, problem.x_l),
            x_u=np.maximum(x_u, problem.x_u),
            h_l=np.minimum(h_l, high - margin),
            h_u=np.maximum(h_u, low + margin),
        )

    def _late(
        self, pushed: Array, least: Array, room: Array, v: Array, flown: Flown | None, side: float
    ) -> Array:
        """Return accelerations (3, n) as ``pushed`` (3, n) until speed or braking distance allow no more.

        They point towards a ``side`` (1 up, −1 down) that is ``room`` (3,) m away, approached at ``v`` (3,)
        m/s. Without a bound on jerk they are not less than ``least`` (3, n); with one, their changes stay
        within it.
        """
        dt, found, room = self.dt, np.empty_like(pushed), room - _INSIDE
        strong = -_SPARE * np.minimum(least[:, -1], 0.0)
        fastest = self._high[:, 0] - _SLOWER
        jerk, step, last = None, dt, np.zeros(3)
        if self._jerk is not None and flown is not None:
            jerk, step, last = np.array(self.limits.j_max), min(flown.elapsed, dt), side * flown.acceleration
        for n in range(self.n):
            lost = dt if jerk is None else dt + strong / (2.0 * jerk)
            stop = np.sqrt(2.0 * strong * np.maximum(room - lost * np.maximum(v, 0.0), 0.0))
            rest = np.minimum(fastest, stop) - v
            # A vehicle that moves away from that side too fast must be slowed down first.
            wanted = np.maximum(pushed[:, n], (-fastest - v) / dt)
            if jerk is None:
                a = np.maximum(np.minimum(wanted, rest / dt), least[:, n])
            else:
                # v + dt a + a²/2j, the speed when a has come back to zero, stays below.
                slow = jerk * (np.sqrt(dt * dt + 2.0 * np.maximum(rest, 0.0) / jerk) - dt)
                back = np.maximum(rest / dt, -np.sqrt(jerk * np.maximum(-rest, 0.0)))
                a = np.minimum(wanted, np.where(rest > 0.0, slow, back))
                a = np.minimum(np.maximum(a, last - jerk * step), last + jerk * step)
                last, step = a, dt
            found[:, n] = a
            room = room - dt * (v + 0.5 * dt * a)
            v = v + dt * a
        return found

    def _opened(self, missing: Array, room: Array, margin: Array) -> Array:
        """Return by how much bounds (3, n) on a give way so that rows (3, 2n) gain what is ``missing`` there.

        They give way within their ``room`` (3, n), by the same share of it at every n. The rows gain a
        ``margin`` in addition.
        """
        # Speed has been treated before: a vehicle that is still too fast cannot be slowed down in time.
        missing = missing[:, self.n :]
        if (missing <= _TOLERANCE).all():
            return np.zeros_like(room)
        gains = self._G_T[:, self.n :]
        gain = np.maximum(room @ gains, _TOLERANCE)
        share = np.where(missing > _TOLERANCE, (missing + margin[:, self.n :]) / gain, 0.0).max(axis=1)
        opened: Array = np.minimum(share, 1.0)[:, None] * room
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

    def _rows(self, problem: Problem) -> tuple[Array, Array]:
        """Return bounds (3, m) of all rows: velocities, positions and, with bounded jerk, changes of a."""
        if self._jerk is None or problem.flown is None:
            return problem.h_l, problem.h_u
        d_l, d_u = self._jerk.bounds(problem.flown)
        return np.hstack([problem.h_l, d_l]), np.hstack([problem.h_u, d_u])

    def solve(self, problem: Problem, omega_scale: float) -> Solution:
        """Solve the three axes, each with no more constraints than necessary.

        The free minimiser is the solution where it lies within the bounds on a and on jerk. Otherwise PIQP
        solves with these bounds, and once more with all constraints where that solution breaks a state limit.
        An axis whose constraints contradict each other is solved without its state limits and counted. Its
        bounds on a and on jerk still hold; where these contradict each other, the bounds on jerk hold. Raises
        SolverError only if even that fails.
        """
        solvers = self._solvers(omega_scale)
        c, x_l, x_u, h_l, h_u = problem[:5]
        a: Array = solvers.minimiser @ c.T
        # Written so that a NaN anywhere fails both comparisons, and reaches a solver that refuses it.
        inside = ((a >= x_l.T) & (a <= x_u.T)).all(axis=0)
        relaxed = 0
        if self._jerk is None or problem.flown is None:
            for i in np.flatnonzero(~inside):
                a[:, i] = solvers.bounded.solve(c[i], x_l[i], x_u[i])
        else:
            d_l, d_u = self._jerk.bounds(problem.flown)
            change = self._jerk.D @ a
            inside &= ((change >= d_l.T) & (change <= d_u.T)).all(axis=0)
            for axis in np.flatnonzero(~inside).tolist():
                a[:, axis], failed = self._bounded(
                    solvers.bounded, self._jerk, problem, axis, d_l[axis], d_u[axis]
                )
                relaxed += failed
        rows = self.G @ a
        kept: NDArray[np.bool_] = np.all((rows >= h_l.T - _TOLERANCE) & (rows <= h_u.T + _TOLERANCE), axis=0)
        if not kept.all():
            opened = self.reachable(problem)
            low, high = self._rows(opened)
            for i in np.flatnonzero(~kept):
                try:
                    a[:, i] = solvers.limited.solve(c[i], opened.x_l[i], opened.x_u[i], low[i], high[i])
                except SolverError:
                    relaxed += 1
            x_l = np.where(kept[:, None], x_l, opened.x_l)
            x_u = np.where(kept[:, None], x_u, opened.x_u)
        if self._jerk is None:
            # PIQP keeps bounds to 1e-8: this clips the rest.
            np.minimum(np.maximum(a, x_l.T), x_u.T, out=a)
        return Solution(a, relaxed)

    def _bounded(
        self, solver: QpSolver, jerk: JerkRows, problem: Problem, i: int, low: Array, high: Array
    ) -> tuple[Array, bool]:
        """Solve one axis with bounds on a and on jerk; return whether these contradict each other, too.

        If they do, the bounds on jerk hold, and a comes as near as they allow to the smallest one within its
        own bounds.
        """
        try:
            return solver.solve(problem.c[i], problem.x_l[i], problem.x_u[i], low, high), False
        except SolverError:
            middle = np.minimum(np.maximum(0.0, problem.x_l[i]), problem.x_u[i])
            return jerk.limited(middle, low, high), True

    def gradient(self, a: Array, x_end: Array, v_end: Array, destination: Array, velocity: Array) -> Array:
        """Return ∇J = ∂J/∂x(N+1) + ∂J/∂u(N), eq. (11), as a vector (3,), divided by Ω_t (Sec. III-D.1).

        The paper adds a state gradient and an input gradient; both are taken in position space here, and the
        division makes k_s and k_tang fit any scale of the weights. The gradient vanishes at the destination.
        """
        w, dt = self.cost, self.dt
        ratio_v = w.omega_t_velocity / w.omega_t_position
        e_x, e_v = x_end - destination, v_end - velocity
        by_input = (w.omega_i / w.omega_t_position) * a[-1] + 0.5 * dt**2 * e_x + ratio_v * dt * e_v
        gradient: Array = 2.0 * (e_x + by_input)
        return gradient

    def _build(self, omega_scale: float) -> _Solvers:
        P = self.hessian(omega_scale)
        minimiser: Array = -np.asarray(np.linalg.inv(P), dtype=np.float64)
        if self._jerk is None:
            return _Solvers(minimiser, QpSolver(P), QpSolver(P, self.G))
        D = self._jerk.D
        return _Solvers(minimiser, QpSolver(P, D), QpSolver(P, np.vstack([self.G, D])))
