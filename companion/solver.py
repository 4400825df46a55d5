"""PIQP: set up once, then only vectors are updated. One dense QP of n variables, used for each axis in turn.

Settled by measurement: no preconditioner (with scaling on, a wrong update can return SOLVED and be wrong),
the duality gap is checked, infinite bounds are real infinities, shapes are validated here because PIQP does
not raise on them, and results are copied because the next solve overwrites them.
"""

from __future__ import annotations

import numpy as np
import piqp

from companion.errors import ShapeError, SolverError
from companion.horizon import Array


class QpSolver:
    """min ½ xᵀPx + cᵀx  subject to  h_l ≤ Gx ≤ h_u,  x_l ≤ x ≤ x_u,  with constant P (n, n) and G (m, n) or
    none."""

    def __init__(self, P: Array, G: Array | None = None, max_iter: int = 60) -> None:
        self.size = len(P)
        self.rows = 0 if G is None else len(G)
        self._solver = piqp.DenseSolver()
        settings = self._solver.settings
        settings.verbose = False
        settings.preconditioner_iter = 0
        settings.max_iter = max_iter
        settings.eps_abs = settings.eps_rel = 1e-8
        settings.check_duality_gap = True
        # At the default gap, 1e-8, the last inputs are off by up to 2e-3 m/s²: this costs one iteration more.
        settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = 1e-10, 1e-12
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
        """The minimiser (n,), a copy. ShapeError on sizes or NaN, SolverError when PIQP does not say
        SOLVED."""
        if len(c) != self.size or len(x_l) != self.size or len(x_u) != self.size:
            raise ShapeError(
                f"c, x_l, x_u must have {self.size} entries, not {len(c)}, {len(x_l)}, {len(x_u)}"
            )
        # A NaN bound would count as absent and the answer as SOLVED; the product finds one in a single pass.
        check = float(c @ (x_u - x_l))
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
        status = self._solver.solve()
        result = self._solver.result
        if status != piqp.PIQP_SOLVED:
            raise SolverError(str(status.name), int(result.info.iter))
        return np.array(result.x)
