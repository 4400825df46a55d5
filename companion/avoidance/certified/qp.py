"""QP of the certified mode: three axes together, because planes couple them; PIQP, with the rows that matter.

Variables are the accelerations of each axis in turn, n for each. The paper's cost weights the last step alone
and adds the field to the acceleration. Here every step is weighted (``cost``), and the field f enters as the
linear term −2 Ω_f f·x of every step: it moves the positions within the constraints. A plan that ends at rest
could not follow a lasting push with its accelerations. The plan ends at rest.

Bounds of acceleration are bounds on variables. Limits of speed and position, the planes and bounds on jerk
are rows Ga ≥ low. Rows that hold for all accelerations within their bounds are left out (``rows_within``).
``active_set`` finds what binds of the others, about ten of seven hundred. PIQP solves the QP with that in its
dual form: with as many variables as bind, the multipliers. Its solution is checked against all rows and
bounds. Where it violates one, or no active set is found, PIQP solves in the accelerations, with the rows that
matter: those within ``_NEAR`` of the committed plan, or violated by the best plan without rows or by an
earlier solution. A limit that the committed plan violates is relaxed until the plan satisfies it, so that
this plan is feasible in every problem.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.certified.active_set import Effects, active_set, effects
from companion.avoidance.certified.cost import arriving, following
from companion.avoidance.certified.minimiser import combine
from companion.avoidance.certified.qp_vectors import write_cost
from companion.avoidance.certified.rows import BOUND, row_slacks, rows_within, write_rows
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
_LIMITS = 24
"""Number of rows of the limits in each step: speed, second and third control point, change of acceleration,
three axes, both ways."""
_TOLERANCE = 1e-5
"""Largest violation of a row (m, m/s) that is accepted; much smaller than the planes' margin."""
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

    ``forces`` (M, 3): of the planes of each obstacle, the sum of their normals times the multipliers ≥ 0.
    ``rounds``: the number of QPs solved.
    """

    accelerations: Array
    forces: Array
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
        self.n, self.dt = n, dt
        self.limits = limits
        S_v, self._S_x, _ = prediction(n, dt)
        self._S_v = np.ascontiguousarray(S_v)
        v, x = (np.vstack([np.zeros((1, n)), part[:-1]]) for part in (self._S_v, self._S_x))
        # ``maps[i] @ a``: what accelerations a add to control point i of each segment, to the velocity after
        # it, and to the change of acceleration before it.
        changes = np.eye(n) - np.eye(n, k=-1)
        self._maps: Array = np.stack([x, x + 0.5 * dt * v, self._S_x, self._S_v, changes])
        self.costs = {
            False: arriving(config, self._S_x, self._S_v, planar=planar),
            True: following(config, self._S_x, self._S_v, planar=planar),
        }
        self._effects = {moving: effects(cost.inverse, self._maps) for moving, cost in self.costs.items()}
        # Constant arguments of ``write_cost``.
        self._cost_parts: dict[bool, Any] = {
            moving: (
                *(cost.places, cost.fields, cost.omega_speed, cost.omega_jerk),
                *(self._S_x, self._S_v, cost.inverse, cost.stopping, dt),
            )
            for moving, cost in self.costs.items()
        }
        self._P = {
            moving: np.asfortranarray(np.kron(np.eye(3), cost.P)) for moving, cost in self.costs.items()
        }
        self._A = np.asfortranarray(np.kron(np.eye(3), self._S_v[-1:]))
        # Memory of ``active_set``, and its parts that are the QP in its dual form, by the number that binds.
        most = _MOST_BINDING
        self._active, self._images = np.zeros(most, np.int64), np.zeros((most, 3, n))
        self._memory = _room_for(0, n)
        self._gram, self._missing = np.zeros(most * most), np.zeros(most)
        self._duals = [
            (self._gram[: size * size].reshape(size, size).T, self._missing[:size])
            for size in range(most + 1)
        ]
        self._a_range: Array = np.array([limits.least_u, limits.u_max])
        self._a_range += np.array([[_ROUNDED], [-_ROUNDED]])
        if planar:
            # The heights stay almost constant: an interior-point method needs an interior.
            self._a_range[:, 2] = -_ROUNDED, _ROUNDED
        self._change: Array = np.full(3, np.inf) if limits.j_max is None else dt * np.array(limits.j_max)
        self._ranges: Array = np.array(
            [[limits.box_min, limits.box_max], [limits.least_v, limits.v_max]], dtype=np.float64
        )

    def solve(
        self, state: State, objective: Objective, planes: Planes, region: Array | None = None
    ) -> Answer:
        """Return the best plan from ``state`` that keeps all rows.

        ``region`` (2, 3), m, from corner to corner: the part of the box of the limits to stay in.
        Raises SolverError if PIQP finds none, or if rows are still violated after ``_ROUNDS`` QPs or although
        the QP holds them.
        """
        if len(self._memory.whose) < planes.wanted.size:
            self._memory = _room_for(planes.wanted.size, self.n)
        c, start, of, normals, low, a_min, a_max, whose = self._memory
        places, velocities, field = map(np.ascontiguousarray, objective[:3])
        known: Any = *state[:3], places, velocities, field, *self._cost_parts[objective.moving], c, start
        write_cost(*known)
        # The planes are made so that the committed plan keeps them.
        ranges = self._ranges
        if region is not None:
            ranges = ranges.copy()
            ranges[0] = np.maximum(ranges[0, 0], region[0]), np.minimum(ranges[0, 1], region[1])
        known = *state[:3], self.dt, state.committed, ranges
        known += planes.normals, planes.wanted, self._a_range, self._change, a_min, a_max, of, normals, low
        known += (whose,)
        of_planes, count = rows_within(*known)
        rows = of[:count], normals[:count], low[:count]
        problem = _Problem(c, start, *rows, a_min, a_max, whose[:of_planes], len(planes.wanted))
        found = self._by_active_set(problem, self._effects[objective.moving])
        return found or self._by_rows(problem, state, self._P[objective.moving])

    def _by_active_set(self, problem: _Problem, effects: Effects) -> Answer | None:
        """Return the solution of what binds; None if there is none, or if it violates a row or bound."""
        rows: Any = problem[2:7]
        memory: Any = self._active, self._images, self._gram, self._missing
        count = active_set(*effects, problem.start, self.dt, *rows, *memory)
        if count < 0:
            return None
        try:
            multipliers = self._multipliers(count)
        except SolverError:
            return None
        a, forces = np.empty((3, self.n)), np.empty((problem.obstacles, 3))
        found: Any = problem.start, self._images, multipliers, self._active, self.dt, *rows
        found += problem.whose, a, forces
        return Answer(a.T, forces, 1) if combine(*found) <= BOUND else None

    def _multipliers(self, count: int) -> Array:
        """Return the multipliers (count,) of the active set, by PIQP; raises SolverError without a result."""
        if count == 0:
            return np.zeros(0)
        result: Array = equation_solver(count, 0).solve(*self._duals[count]).x
        return result

    def _by_rows(self, problem: _Problem, state: State, P: Array) -> Answer:
        """Return PIQP's solution in the accelerations, with the rows that matter.

        Raises SolverError as ``solve`` describes.
        """
        c, start, of, normals, low, a_min, a_max, whose, obstacles = problem
        best = np.minimum(np.maximum(start, a_min), a_max)
        candidates = self._slacks(problem, state.committed.T) < _NEAR
        candidates |= self._slacks(problem, best) < 0.0
        for count in range(1, _ROUNDS + 1):
            chosen = np.flatnonzero(candidates)
            G = np.empty((len(chosen), 3, self.n))
            write_rows(chosen, of, normals, self._maps, G)
            rows = G.reshape(len(chosen), 3 * self.n), low[chosen]
            found = solve_once(P, c.ravel(), self._A, -state.velocity, *rows, a_min.ravel(), a_max.ravel())
            a: Array = found.x.reshape(3, self.n)
            broken = self._slacks(problem, a) < -_TOLERANCE
            if not broken.any():
                planes = chosen[chosen < len(whose)]
                forces = np.zeros((obstacles, 3))
                np.add.at(forces, whose[planes], found.multipliers[: len(planes), None] * normals[planes])
                return Answer(a.T, forces, count)
            if not (broken & ~candidates).any():
                break
            candidates |= broken
        raise SolverError("rows are broken", count)

    def _slacks(self, problem: _Problem, a: Array) -> Array:
        """Return the slack of each row, negative if violated; ``a`` (3, n), m/s²."""
        slack = np.empty(len(problem.low))
        row_slacks(np.ascontiguousarray(a), self.dt, problem.of, problem.normals, problem.low, slack)
        return slack


class _Memory(NamedTuple):
    """Memory of a ``_Problem``, which the next one overwrites."""

    c: Array
    start: Array
    of: NDArray[np.int64]
    normals: Array
    low: Array
    a_min: Array
    a_max: Array
    whose: NDArray[np.int64]


def _room_for(planes: int, n: int) -> _Memory:
    """Return memory for a problem of ``n`` steps with up to ``planes`` rows of planes."""
    rows = _LIMITS * n + planes
    c, start, a_min, a_max = np.empty((4, 3, n))
    of, whose = np.empty(rows, np.int64), np.empty(planes, np.int64)
    return _Memory(c, start, of, np.empty((rows, 3)), np.empty(rows), a_min, a_max, whose)


class _Problem(NamedTuple):
    """One problem, by axis: c and the best plan without inequalities, (3, n).

    ``of`` (R,), ``normals`` (R, 3) and ``low`` (R,) are the rows of ``rows_within``; ``a_min``, ``a_max``
    (3, n) the bounds of the accelerations. The first rows are those of planes, of which ``whose`` (P,) names
    the obstacles, out of ``obstacles``.
    """

    c: Array
    start: Array
    of: NDArray[np.int64]
    normals: Array
    low: Array
    a_min: Array
    a_max: Array
    whose: NDArray[np.int64]
    obstacles: int
