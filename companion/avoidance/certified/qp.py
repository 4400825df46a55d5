"""QP of the certified mode: three axes together, because planes couple them; PIQP, with the rows that matter.

Variables are the accelerations of each axis in turn, n for each. The paper's cost weights the last step alone
and adds the field to the acceleration. Here every step is weighted (``cost``), and the field f enters as the
linear term −2 Ω_f f·x of every step: it moves the positions within the constraints. A plan that ends at rest
could not follow a lasting push with its accelerations. The plan ends at rest.

Bounds of acceleration are bounds on variables. Limits of speed and position, the planes and bounds on jerk
are rows Ga ≥ low.
``active_set`` finds what binds, about ten of seven hundred. PIQP solves the QP with that in its dual form:
with as many variables as bind, the multipliers. Its solution is checked against all rows and bounds. Where it
violates one, or no active set is found, PIQP solves in the accelerations, with the rows that matter: those
within ``_NEAR`` of the committed plan, or violated by the best plan without rows or by an earlier solution.
A limit that the committed plan violates is relaxed until the plan satisfies it, so that this plan is feasible
in every problem.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.cost import arriving, following
from companion.avoidance.certified.qp_vectors import row_bounds, write_cost, write_start
from companion.avoidance.certified.rows import (
    active_set,
    combine,
    relax_limits,
    row_slacks,
    write_rows,
)
from companion.avoidance.certified.separating_planes import Planes
from companion.avoidance.solver import equation_solver, solve_once
from companion.config.certified import CertifiedConfig
from companion.config.planning import LimitsConfig
from companion.errors import SolverError
from companion.values.horizon import Array
from companion.values.prediction import prediction

_ROUNDS = 8
_NEAR = 0.1
"""Distance (m/s, m) of the committed plan within which a row takes part from the first solution on."""
_KINDS = 18
"""Number of rows of the limits in each step: speed, second and third control point, three axes, both ways."""
_TOLERANCE = 1e-5
"""Largest violation of a row (m, m/s) that is accepted; much smaller than the planes' margin."""
_BOUND = 1e-7
"""Largest violation of a bound of acceleration or row (m, m/s, m/s²) of a dual solution that is accepted."""
_MOST_BINDING = 64
"""Largest number of rows and bounds of a QP in its dual form."""
_ROUNDED = 0.01
"""Tightening of the acceleration bounds (m/s²).

Rounding, and the correction to an exact stop, do not violate them then.
"""


class State(NamedTuple):
    """Beginning of a plan: position (3,), m, and velocity (3,), m/s.

    ``before`` (3,), m/s², is the acceleration until then; ``committed`` (n, 3), m/s², are the accelerations
    that the committed plan has from there on.
    """

    position: Array
    velocity: Array
    before: Array
    committed: Array


class Objective(NamedTuple):
    """Preferred places (n, 3), m, and velocities (n, 3), m/s, after each step.

    ``field``: the field f (n, 3), m/s², that the plan yields to. ``moving``: whether the places are those of
    a destination that moves, which the plan follows.
    """

    places: Array
    velocities: Array
    field: Array
    moving: bool = False


class Answer(NamedTuple):
    """Accelerations (n, 3), m/s², of a solution.

    ``plane_multipliers`` (M, n, 3) ≥ 0: the multipliers of the planes' rows. ``rounds``: the number of QPs
    solved.
    """

    accelerations: Array
    plane_multipliers: Array
    rounds: int


class SeparationQp:
    """Matrices of the QP for ``steps`` accelerations; call ``solve`` for each plan.

    ``planar``: the vertical acceleration is bounded to ±0.01 m/s², so that the height stays. With
    ``limits.j_max`` the acceleration changes by at most j_max·dt from step to step, from the one before the
    plan to the rest after its end.
    """

    def __init__(
        self, steps: int, limits: LimitsConfig, config: CertifiedConfig, *, planar: bool = False
    ) -> None:
        n, dt = steps, config.dt_us * 1e-6
        self.n = n
        S_v, self._S_x, _ = prediction(n, dt)
        self.dt, self.S_v = dt, np.ascontiguousarray(S_v)
        v, x = (np.vstack([np.zeros((1, n)), part[:-1]]) for part in (self.S_v, self._S_x))
        # ``maps[b] @ a``: what the accelerations a add to control point b of each segment, (3, n, n).
        self.maps: Array = np.stack([x, x + 0.5 * dt * v, self._S_x])
        self.costs = {
            moving: cost(config, self._S_x, self.S_v)
            for moving, cost in ((False, arriving), (True, following))
        }
        self._P = {
            moving: np.asfortranarray(np.kron(np.eye(3), cost.P)) for moving, cost in self.costs.items()
        }
        self._A = np.asfortranarray(np.kron(np.eye(3), self.S_v[-1:]))
        # Memory of ``active_set``.
        most = _MOST_BINDING
        self._active = np.zeros(most, np.int64)
        self._images, self._gram = np.zeros((most, 3, n)), np.zeros((most, most))
        self._missing = np.zeros(most)
        a_max = np.array(limits.u_max) - _ROUNDED
        if planar:
            # The heights stay almost constant: an interior-point method needs an interior.
            a_max[2] = _ROUNDED
        self._a_max = np.repeat(a_max[:, None], n, axis=1)
        self._change: Array | None = None
        if limits.j_max is not None:
            self._change = np.array(limits.j_max) * dt
            self._a_max[:, -1] = np.minimum(a_max, self._change)
        v_max, low, high = (
            np.repeat(np.array(bound, dtype=np.float64), n)
            for bound in (limits.v_max, limits.box_min, limits.box_max)
        )
        # Speeds after each step, and control points except the first of each segment, both ways.
        self.limits_low: Array = np.concatenate([-v_max, -v_max, low, -high, low, -high])

    def solve(self, state: State, objective: Objective, planes: Planes) -> Answer:
        """Return the best plan from ``state`` that keeps all rows.

        Raises SolverError if PIQP finds none, or if rows are still violated after ``_ROUNDS`` QPs or although
        the QP holds them.
        """
        n, cost = self.n, self.costs[objective.moving]
        c, start = np.empty((3, n)), np.empty((3, n))
        places, velocities, field = map(np.ascontiguousarray, objective[:3])
        write_cost(
            state.position,
            state.velocity,
            state.before,
            places,
            velocities,
            field,
            cost.places,
            cost.fields,
            cost.omega_speed,
            cost.omega_jerk,
            self._S_x,
            self.S_v,
            self.dt,
            c,
        )
        write_start(c, state.velocity, cost.inverse, cost.stopping, start)
        flown = np.ascontiguousarray(state.committed.T)
        count = _KINDS * n + planes.normals.size
        low = np.empty(count if self._change is None else count + 6 * n)
        row_bounds(
            state.position, state.velocity, self.dt, self.limits_low, planes.normals, planes.wanted, low
        )
        # The planes are made so that the committed plan keeps them.
        relax_limits(flown, self.dt, low)
        a_min, a_max = -self._a_max, self._a_max
        if self._change is not None:
            a_min, a_max = self._bound_jerk(self._change, state.before, flown, low[count:])
        bounds = np.minimum(a_min, flown), np.maximum(a_max, flown)
        problem = _Problem(objective.moving, c, start, flown, state.velocity, planes.normals, low, *bounds)
        return self._by_active_set(problem) or self._by_rows(problem)

    def _bound_jerk(self, change: Array, before: Array, flown: Array, low: Array) -> tuple[Array, Array]:
        """Write the bounds ``low`` (6n,) of the changes of acceleration; return those of a, (3, n) each.

        ``change`` (3,), m/s²: the largest from step to step; ``before`` (3,): acceleration until the plan
        begins. A change that the committed accelerations ``flown`` (3, n) exceed is bounded by theirs. The
        first step has bounds of its acceleration and no row.
        """
        changes = np.diff(flown, axis=1, prepend=0.0)
        bounds = low.reshape(2, 3, self.n)
        np.minimum(-change[:, None], changes, out=bounds[0])
        np.minimum(-change[:, None], -changes, out=bounds[1])
        bounds[:, :, 0] = -np.inf
        a_min, a_max = -self._a_max, self._a_max.copy()
        a_min[:, 0] = np.maximum(a_min[:, 0], before - change)
        a_max[:, 0] = np.minimum(a_max[:, 0], before + change)
        return a_min, a_max

    def _by_active_set(self, problem: _Problem) -> Answer | None:
        """Return the solution of what binds; None if there is none, or if it violates a row or bound."""
        count = active_set(
            self.costs[problem.moving].inverse,
            problem.start,
            self.dt,
            self.S_v,
            self.maps,
            problem.normals,
            problem.low,
            problem.a_min,
            problem.a_max,
            self._active,
            self._images,
            self._gram,
            self._missing,
        )
        if count < 0:
            return None
        try:
            multipliers = self._multipliers(count)
        except SolverError:
            return None
        a, of_rows = np.empty((3, self.n)), np.zeros(len(problem.low))
        violation = combine(
            problem.start,
            self._images,
            multipliers,
            self._active,
            self.dt,
            problem.normals,
            problem.low,
            problem.a_min,
            problem.a_max,
            a,
            of_rows,
        )
        if not violation <= _BOUND:
            return None
        return Answer(a.T, self._of_planes(problem, of_rows), 1)

    def _multipliers(self, count: int) -> Array:
        """Return the multipliers (count,) of the active set, by PIQP; raises SolverError without a result."""
        if count == 0:
            return np.zeros(0)
        gram = np.asfortranarray(self._gram[:count, :count])
        result: Array = equation_solver(count, 0).solve(gram, -self._missing[:count]).x
        return result

    def _by_rows(self, problem: _Problem) -> Answer:
        """Return PIQP's solution in the accelerations, with the rows that matter.

        Raises SolverError as ``solve`` describes.
        """
        best = np.minimum(np.maximum(problem.start, problem.a_min), problem.a_max)
        candidates = self._slacks(problem, problem.flown) < _NEAR
        candidates |= self._slacks(problem, best) < 0.0
        a_min, a_max = problem.a_min.ravel(), problem.a_max.ravel()
        for count in range(1, _ROUNDS + 1):
            chosen = np.flatnonzero(candidates)
            G = np.empty((len(chosen), 3, self.n))
            write_rows(chosen, self.S_v, self.maps, problem.normals, G)
            rows = G.reshape(len(chosen), 3 * self.n), problem.low[chosen]
            found = solve_once(
                self._P[problem.moving], problem.c.ravel(), self._A, -problem.velocity, *rows, a_min, a_max
            )
            a: Array = found.x.reshape(3, self.n)
            broken = self._slacks(problem, a) < -_TOLERANCE
            if not broken.any():
                of_rows = np.zeros(len(candidates))
                of_rows[chosen] = found.multipliers
                return Answer(a.T, self._of_planes(problem, of_rows), count)
            if not (broken & ~candidates).any():
                break
            candidates |= broken
        raise SolverError("rows are broken", count)

    def _slacks(self, problem: _Problem, a: Array) -> Array:
        """Return the slack G a − low of each row, negative if violated; ``a`` (3, n), m/s²."""
        slack = np.empty(len(problem.low))
        row_slacks(a, self.dt, problem.normals, problem.low, slack)
        return slack

    def _of_planes(self, problem: _Problem, of_rows: Array) -> Array:
        """Return the multipliers (M, n, 3) of the planes' rows, of those ``of_rows`` (R,)."""
        first = _KINDS * self.n
        return of_rows[first : first + problem.normals.size].reshape(*problem.normals.shape[:2], 3)


class _Problem(NamedTuple):
    """One problem, by axis: c, the best plan without inequalities, and the committed accelerations, (3, n).

    ``moving``: whether the destination moves. ``velocity`` (3,); normals (M, n, 3) of the planes; ``low``
    (R,) of the rows: those of the limits, of the planes, and of the jerk, in this order; bounds of the
    accelerations, (3, n).
    """

    moving: bool
    c: Array
    start: Array
    flown: Array
    velocity: Array
    normals: Array
    low: Array
    a_min: Array
    a_max: Array
