"""QP of the certified mode: three axes together, because planes couple them; PIQP, with the rows that matter.

Variables are the accelerations of each axis in turn, n for each. The paper's cost weights the last step alone
and adds the field to the acceleration. Here every step is weighted, and the field f enters as the linear term
−2 Ω_f f·x of every step: it moves the positions within the constraints. A plan that ends at rest could not
follow a lasting push with its accelerations. The plan ends at rest.

Bounds of acceleration are bounds on variables. Limits of speed and position and the planes are rows Ga ≥ low.
A row is a candidate if the committed plan is within ``_NEAR`` of it, or if the best plan without rows or an
earlier solution violates it. The QP holds the candidates that bind, or all candidates if ``binding_rows``
finds no solution. Its solution is checked against all rows, and the next QP holds the rows that it violates.
A limit that the committed plan violates is relaxed until the plan satisfies it, so that this plan is feasible
in every problem.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.certified.active_set import binding_rows
from companion.avoidance.certified.rows import row_bounds, row_columns, row_slacks
from companion.avoidance.certified.separating_planes import Planes
from companion.avoidance.solver import solve_once
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

    ``field``: the field f (n, 3), m/s², that the plan yields to.
    """

    places: Array
    velocities: Array
    field: Array


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

    ``planar``: the vertical acceleration is bounded to ±0.01 m/s², so that the height stays.
    """

    def __init__(
        self, steps: int, limits: LimitsConfig, config: CertifiedConfig, *, planar: bool = False
    ) -> None:
        n, dt = steps, config.dt_us * 1e-6
        self.n, self._config = n, config
        S_v, self._S_x, _ = prediction(n, dt)
        self.dt, self.S_v = dt, np.ascontiguousarray(S_v)
        v, x = (np.vstack([np.zeros((1, n)), part[:-1]]) for part in (self.S_v, self._S_x))
        # ``maps[b] @ a``: what the accelerations a add to control point b of each segment, (3, n, n);
        # ``_times``: the times (s) of the control points since the beginning, (n, 3).
        self.maps: Array = np.stack([x, x + 0.5 * dt * v, self._S_x])
        self._times: Array = dt * (np.arange(n)[:, None] + np.array([0.0, 0.5, 1.0]))
        self._weights = np.full(n, config.omega_place)
        self._weights[-1] = config.omega_end
        # ``change @ a``: a_k − a_{k−1}; for k = 0, ``_cost`` subtracts the acceleration flown until then.
        change = np.eye(n) - np.eye(n, k=-1)
        one = 2.0 * (
            self._S_x.T @ (self._weights[:, None] * self._S_x)
            + config.omega_speed * self.S_v.T @ self.S_v
            + config.omega_input * np.eye(n)
            + config.omega_jerk * change.T @ change
        )
        self._P = np.asfortranarray(np.kron(np.eye(3), one))
        self._A = np.asfortranarray(np.kron(np.eye(3), self.S_v[-1:]))
        # Inverse of the optimality conditions without rows and bounds: the best plan is then one product.
        conditions = np.block([[self._P, self._A.T], [self._A, np.zeros((3, 3))]])
        inverse = np.linalg.inv(conditions)
        self._without_rows: Array = inverse[: 3 * n]
        self._inverse: Array = np.ascontiguousarray(inverse[: 3 * n, : 3 * n])
        self.gradient_per_metre = 2.0 * float(self._weights.sum())
        """Derivative of the cost by a shift of the whole plan, one metre from all its preferred places."""
        a_max = np.array(limits.u_max) - _ROUNDED
        if planar:
            # The heights stay almost constant: an interior-point method needs an interior.
            a_max[2] = _ROUNDED
        self._a_max = np.repeat(a_max, n)
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
        c = self._cost(state, objective)
        rows = _Rows(self, state, planes)
        flown = state.committed.T.ravel()
        a_max = np.maximum(self._a_max, flown)
        a_min = np.minimum(-self._a_max, flown)
        best = self._without_rows @ np.concatenate([-c, -state.velocity])
        clipped = np.minimum(np.maximum(best, a_min), a_max).reshape(3, self.n).T
        candidates = (rows.values(state.committed) < _NEAR) | (rows.values(clipped) < 0.0)
        # A row that does not quite bind may be broken by the solver's error: then the solver gets it, too.
        given = np.zeros(len(candidates), dtype=np.bool_)
        for count in range(1, _ROUNDS + 1):
            chosen = np.flatnonzero(candidates)
            G_T, low = rows.chosen(chosen)
            binding = np.empty(3 * self.n, np.int64)
            found_rows = binding_rows(self._inverse, best, G_T, low, a_min, a_max, binding)
            if found_rows >= 0:
                binding = np.union1d(binding[:found_rows], np.flatnonzero(given[chosen]))
                chosen, G_T, low = chosen[binding], G_T[:, binding], low[binding]
            found = solve_once(self._P, c, self._A, -state.velocity, G_T.T, low, a_min, a_max)
            a: Array = found.x.reshape(3, self.n).T
            broken = rows.values(a) < -_TOLERANCE
            if not broken.any():
                return Answer(a, rows.plane_multipliers(chosen, found.multipliers), count)
            if not (broken & ~given).any():
                break
            candidates |= broken
            given |= broken
        raise SolverError("rows are broken", count)

    def _cost(self, state: State, objective: Objective) -> Array:
        """Return c (3n,)."""
        config = self._config
        ends = state.position + self._times[:, 2, None] * state.velocity
        flown = np.zeros_like(objective.field)
        flown[0] = state.before
        deviation = self._weights[:, None] * (ends - objective.places) - config.omega_field * objective.field
        c: Array = 2.0 * (
            self._S_x.T @ deviation
            + config.omega_speed * self.S_v.T @ (state.velocity - objective.velocities)
            - config.omega_jerk * flown
        )
        return c.T.ravel()


class _Rows:
    """All rows of one problem: first those of the limits, then those of the planes.

    Rows are written out only where they are candidates.
    """

    def __init__(self, program: SeparationQp, state: State, planes: Planes) -> None:
        self._program, self._normals = program, planes.normals
        self._split = _KINDS * program.n
        self._low: Array = np.empty(self._split + planes.normals.size)
        row_bounds(
            state.position,
            state.velocity,
            program.dt,
            program.limits_low,
            self._normals,
            planes.wanted,
            self._low,
        )
        # The planes are made so that the committed plan keeps them.
        self._low[: self._split] -= np.maximum(-self.values(state.committed)[: self._split], 0.0)

    def values(self, a: Array) -> Array:
        """Return the slack G a − low of each row, negative if violated; ``a`` (n, 3), m/s²."""
        slack = np.empty(len(self._low))
        row_slacks(np.ascontiguousarray(a), self._program.dt, self._normals, self._low, slack)
        return slack

    def chosen(self, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return Gᵀ (3n, R) and low (R,) of the given ``rows`` (R,)."""
        G_T = np.zeros((3 * self._program.n, len(rows)))
        row_columns(rows, self._program.S_v, self._program.maps, self._normals, G_T)
        return G_T, self._low[rows]

    def plane_multipliers(self, rows: NDArray[np.intp], multipliers: Array) -> Array:
        """Return the multipliers (M, n, 3) of the planes' rows from those of the given ``rows`` (R,)."""
        every = np.zeros(len(self._low))
        every[rows] = multipliers
        return every[self._split :].reshape(*self._normals.shape[:2], 3)
