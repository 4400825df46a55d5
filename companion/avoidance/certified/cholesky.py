"""Cholesky factor of a symmetric positive definite matrix that grows by rows, as parts of kernels."""

from __future__ import annotations

from math import sqrt

from companion.values.compiled import part
from companion.values.horizon import Array


@part
def write_factor(M: Array, first: int, count: int, L: Array) -> None:
    """Write rows ``first`` to ``count`` of the Cholesky factor ``L`` of M, whose rows before are known.

    On its diagonal are the reciprocals: a division takes several times as long as a product.
    """
    for i in range(first, count):
        for j in range(i + 1):
            rest = M[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j] = 1.0 / sqrt(max(rest, 1e-300)) if i == j else rest * L[j, j]


@part
def solve_factored(L: Array, count: int, b: Array) -> None:
    """Replace the first ``count`` entries of ``b`` by the solution y of L Lᵀ y = b.

    ``L`` is as ``write_factor`` writes it.
    """
    for i in range(count):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] *= L[i, i]
    for i in range(count - 1, -1, -1):
        b[i] *= L[i, i]
        for k in range(i):
            b[k] -= L[i, k] * b[i]
