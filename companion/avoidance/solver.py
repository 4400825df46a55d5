"""PIQP solvers: set up once, with updates of the vectors only (``QpSolver``), or per QP (``solve_once``).

The field uses one dense ``QpSolver`` of n variables for each axis in turn. Choices confirmed by measurement:
no preconditioner (with scaling on, a wrong update can return SOLVED with a wrong result), the duality gap is
checked, absent bounds are infinities, ``QpSolver`` validates shapes because PIQP does not raise on them, and
results are copied because the next solve overwrites them.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import piqp

from companion.errors import ShapeError, SolverError
from companion.values.compiled import FLOAT, array, kernel
from companion.values.horizon import Array


class QpSolver:
    """Solver of min ½ xᵀPx + cᵀx subject to h_l ≤ Gx ≤ h_u, x_l ≤ x ≤ x_u.

    P (n, n) and G (m, n) or None are constant; without G there are no rows h.
    """

    def __init__(self, P: Array, G: Array | None = None, max_iter: int = 60) -> None:
        self.size = len(P)
        self.rows = 0 if G is None else len(G)
        # At the default gap, 1e-8, the last inputs are wrong by up to 2e-3 m/s²; this gap costs one more
        # iteration.
        self._solver = _dense_solver(max_iter, 1e-8, (1e-10, 1e-12))
        wide, tall = np.full(self.size, 1.0), np.full(self.rows, 1.0)
        P = np.asfortranarray(P)
        if G is None:
            self._solver.setup(P, np.zeros(self.size), None, None, None, None, None, -wide, wide)
        else:
            self._solver.setup(
                P, np.zeros(self.size), None, None, np.asfortranarray(G), -tall, tall, -wide, wide
            )

    def solve(
        self, c: Array, x_l: Array, x_u: Array, h_l: Array | None = None, h_u: Array | None = None
    ) -> Array:
        """Return the minimiser (n,), a copy.

        Raises ShapeError on wrong sizes or NaN, SolverError when PIQP does not report SOLVED.
        """
        if len(c) != self.size or len(x_l) != self.size or len(x_u) != self.size:
            raise ShapeError(
                f"c, x_l, x_u must have {self.size} entries, not {len(c)}, {len(x_l)}, {len(x_u)}"
            )
        # PIQP would treat a NaN bound as absent and report SOLVED. A NaN in any vector makes the sum NaN.
        check = _sum(c, x_l, x_u)
        if self.rows:
            if h_l is None or h_u is None or len(h_l) != self.rows or len(h_u) != self.rows:
                raise ShapeError(f"h_l and h_u must have {self.rows} entries")
            check += float(h_l @ h_u)
        if check != check:
            raise ShapeError("NaN in the QP's vectors")
        if self.rows:
            self._solver.update(c=c, h_l=h_l, h_u=h_u, x_l=x_l, x_u=x_u)
        else:
            self._solver.update(c=c, x_l=x_l, x_u=x_u)
        return np.array(_solved(self._solver).x)


_NONE = np.zeros(0)


class EquationSolver:
    """Solver of min ½ yᵀPy + cᵀy subject to Ay = b, with ``size`` variables and ``rows`` equations.

    All matrices differ each time; they are not validated.
    """

    def __init__(self, size: int, rows: int) -> None:
        self._rows = rows
        self._solver = _dense_solver(60, 1e-10, (1e-10, 1e-12))
        # Without inequalities the system stays well conditioned: with less regularisation than usual one
        # iteration suffices, and errors are 3e-9 at most instead of 1e-8.
        self._solver.settings.rho_init = self._solver.settings.delta_init = 1e-8
        P, c = np.eye(size, order="F"), np.zeros(size)
        if rows:
            self._solver.setup(P, c, np.eye(rows, size, order="F"), np.zeros(rows))
        else:
            self._solver.setup(P, c)

    def solve(self, P: Array, c: Array, A: Array = _NONE, b: Array = _NONE) -> Any:
        """Return PIQP's result: ``x`` (size,) and the multipliers ``y`` (rows,), overwritten by the next.

        P (size, size) and A (rows, size) are stored column by column. Raises SolverError when PIQP does not
        report SOLVED.
        """
        if self._rows:
            self._solver.update(P=P, c=c, A=A, b=b)
        else:
            self._solver.update(P=P, c=c)
        return _solved(self._solver)


@cache
def equation_solver(size: int, rows: int) -> EquationSolver:
    """Return the process's solver of this size: PIQP keeps nothing from one solve to the next."""
    return EquationSolver(size, rows)


@kernel(FLOAT, array(1), array(1), array(1))
def _sum(c: Array, x_l: Array, x_u: Array) -> float:
    """Return c·(x_u − x_l), of vectors of one length."""
    total = 0.0
    for k in range(len(c)):
        total += c[k] * (x_u[k] - x_l[k])
    return total


class Optimum(NamedTuple):
    """Minimiser ``x`` (n,) and ``multipliers`` (m,) ≥ 0 of the rows Gx ≥ low, both copies."""

    x: Array
    multipliers: Array


def solve_once(
    P: Array, c: Array, A: Array, b: Array, G: Array, low: Array, x_l: Array, x_u: Array
) -> Optimum:
    """Solve min ½ xᵀPx + cᵀx subject to Ax = b, Gx ≥ low, x_l ≤ x ≤ x_u.

    This is for a QP whose rows G (m, n), m ≥ 0, differ each time. The vectors are not validated. Raises
    SolverError when PIQP does not report SOLVED.
    """
    # 20 iterations are mostly enough; a QP with nearly no interior takes many more.
    solver = _dense_solver(250, 1e-8, (1e-9, 1e-9))
    rows = (np.asfortranarray(G), low, np.full(len(low), np.inf)) if len(low) else (None, None, None)
    solver.setup(P, c, A, b, *rows, x_l, x_u)
    result = _solved(solver)
    return Optimum(np.array(result.x), np.array(result.z_l) if len(low) else np.zeros(0))


def _dense_solver(max_iter: int, eps: float, gap: tuple[float, float]) -> Any:
    """Return a dense solver with tolerance ``eps`` and, for the gap, ``gap`` (absolute, relative)."""
    solver = piqp.DenseSolver()
    settings = solver.settings
    settings.verbose = False
    settings.preconditioner_iter = 0
    settings.max_iter = max_iter
    settings.eps_abs = settings.eps_rel = eps
    settings.check_duality_gap = True
    settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = gap
    return solver


def _solved(solver: Any) -> Any:
    """Return the result of a solver that is set up; raises SolverError unless it reports SOLVED."""
    status = solver.solve()
    result = solver.result
    if status != piqp.PIQP_SOLVED:
        raise SolverError(str(status.name), int(result.info.iter))
    return result
