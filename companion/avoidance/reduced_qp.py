"""QPs solved by PIQP for what a working set leaves open, and verified as solutions of the whole QP.

``working_sets`` finds the bounds and rows that bind. PIQP then solves the QP in the free variables with the
binding rows as equations: as no inequality is left, that takes it one iteration instead of ten. Nothing is
left to solve where the minimiser without constraints keeps them all, or where the bounds fix all variables.
PIQP's solution must fulfil the optimality conditions of the whole QP; where it does not, and where no working
set is found, PIQP solves the whole QP.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.solver import EquationSolver, QpSolver, equation_solver
from companion.avoidance.working_set import verified, working_sets
from companion.errors import SolverError
from companion.values.horizon import Array


class Vectors(NamedTuple):
    """Vectors of K QPs: c, x_l, x_u (K, n), and h_l, h_u (K, m) of the rows."""

    c: Array
    x_l: Array
    x_u: Array
    h_l: Array
    h_u: Array


class Guess(NamedTuple):
    """Guessed minimisers ``x`` (K, n); ``missing``: the QPs without a guess."""

    x: Array
    missing: list[int]


class _Sets(NamedTuple):
    """Working sets: numbers (K, 2) of free variables and of rows; these, and the rows' sides, (K, n)."""

    sizes: NDArray[np.int64]
    free: NDArray[np.int64]
    rows: NDArray[np.int64]
    sides: NDArray[np.int64]


class _Parts(NamedTuple):
    """Reduced QPs: P (K, n²), c (K, n), A (K, n²), b (K, n), each filled from the beginning."""

    P: Array
    c: Array
    A: Array
    b: Array


class _Reduced(NamedTuple):
    """Solver for one size of reduced QPs, and for each of the K places the views of its P, c, A, b."""

    solver: EquationSolver
    views: list[tuple[Array, Array, Array, Array]]


class ReducedQp:
    """K QPs min ½ xᵀPx + cᵀx, x_l ≤ x ≤ x_u, h_l ≤ Gx ≤ h_u with common P (n, n) and G (m, n), m ≥ 0."""

    def __init__(self, P: Array, G: Array, count: int) -> None:
        n = len(P)
        self._P, self._G = np.ascontiguousarray(P), np.ascontiguousarray(G)
        self._minimiser: Array = -np.asarray(np.linalg.inv(P), dtype=np.float64)
        self._whole = QpSolver(P, G if len(G) else None)
        self._sets = _Sets(*(np.zeros((count, size), np.int64) for size in (2, n, n, n)))
        # Memory that the kernels and PIQP share; y and the multipliers are the reduced QPs' solutions.
        self._parts = _Parts(*(np.zeros((count, size)) for size in (n * n, n, n * n, n)))
        self._y, self._multipliers = np.zeros((count, n)), np.zeros((count, n))
        self._reduced: dict[tuple[int, int], _Reduced] = {}

    def solve(self, vectors: Vectors) -> Array:
        """Return the minimisers (K, n).

        Raises ShapeError on NaN, SolverError when PIQP does not report SOLVED.
        """
        every = range(len(vectors.c))
        guess = self.guess(vectors, every)
        for i in guess.missing + self.settle(vectors, guess, every):
            guess.x[i] = self.solve_whole(vectors, i)
        return guess.x

    def guess(self, vectors: Vectors, which: Sequence[int]) -> Guess:
        """Return guessed minimisers of the QPs ``which``; ``settle`` must follow before the next guess."""
        x = np.empty(vectors.c.shape)
        bits = working_sets(
            self._P, self._G, self._minimiser, *vectors, _bits(which), x, *self._sets, *self._parts
        )
        return Guess(x, [i for i in which if bits >> i & 1] if bits else [])

    def settle(self, vectors: Vectors, guess: Guess, which: Sequence[int]) -> list[int]:
        """Replace the guess by PIQP's solutions for the QPs ``which``; return those that it breaks.

        Those need the whole QP, as those without a guess do.
        """
        n, sizes = vectors.c.shape[1], self._sets.sizes.tolist()
        solved = failed = 0
        for i in which:
            size, held = sizes[i]
            if size > 0 and (size < n or held):
                try:
                    self._solve(i, size, held)
                    solved |= 1 << i
                except SolverError:
                    failed |= 1 << i
        if solved:
            failed |= solved & ~verified(
                self._P, self._G, *vectors, solved, *self._sets, self._y, self._multipliers, guess.x
            )
        return [i for i in which if failed >> i & 1] if failed else []

    def solve_whole(self, vectors: Vectors, i: int) -> Array:
        """Return the minimiser (n,) of QP ``i``, solved by PIQP with all that it has.

        Raises ShapeError on NaN, SolverError when PIQP does not report SOLVED.
        """
        rows = (vectors.h_l[i], vectors.h_u[i]) if len(self._G) else ()
        return self._whole.solve(vectors.c[i], vectors.x_l[i], vectors.x_u[i], *rows)

    def _solve(self, i: int, size: int, held: int) -> None:
        """Solve the reduced QP at place ``i`` by PIQP."""
        found = self._reduced.get((size, held))
        if found is None:
            found = self._reduced[size, held] = self._made(size, held)
        result = found.solver.solve(*found.views[i])
        self._y[i, :size] = result.x
        if held:
            self._multipliers[i, :held] = result.y

    def _made(self, size: int, held: int) -> _Reduced:
        """Return the solver for ``size`` free variables and ``held`` rows."""
        P, c, A, b = self._parts
        views = [
            (
                P[i, : size * size].reshape(size, size),
                c[i, :size],
                A[i, : held * size].reshape(size, held).T,
                b[i, :held],
            )
            for i in range(len(c))
        ]
        # P is symmetric: its rows are its columns.
        return _Reduced(equation_solver(size, held), [(P.T, c, A, b) for P, c, A, b in views])


def _bits(which: Sequence[int]) -> int:
    """Return the bits of the QPs ``which``."""
    return sum([1 << i for i in which])
