"""Working sets: the bounds and rows that bind at the minimiser of a strictly convex QP.

Primal–dual active-set method (M. Hintermüller, K. Ito and K. Kunisch, "The primal-dual active set strategy as
a semismooth Newton method", 2003): with a guess of what binds, the minimiser with that held is one linear
system; free variables beyond a bound are then fixed to it, and what is held with a multiplier of the wrong
sign is released, all at once. Where this cycles, one variable changes at a time (K. G. Murty's rule, which
ends). The first rows join together, each with a variable that keeps it; then one joins at a time, the most
violated first. The result is a guess that the caller must verify. Search and verification share parts: that
makes it long.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from companion.values.compiled import INT, array, kernel, output, part
from companion.values.horizon import Array

_TOLERANCE = 1e-9
"""Violation of a bound or row, and of a multiplier's sign, that ends the search."""
_TOGETHER, _MAX_STEPS = 10, 60
"""Steps in which all changes are made at once, and steps after which the search is given up."""
_DEPENDENT = 1e-12
"""Pivot below which a row counts as a combination of the rows and bounds that are held."""
_KEPT, _BALANCED = 1e-7, 1e-7
"""Violation of a bound or row, and of an optimality condition, that ``verified`` accepts."""


@part
def _factor(M: Array, size: int) -> bool:
    """Replace the lower triangle of ``M`` (size, size) by its Cholesky factor; False if M is singular."""
    for i in range(size):
        for j in range(i + 1):
            rest = M[i, j]
            for k in range(j):
                rest -= M[i, k] * M[j, k]
            if i > j:
                M[i, j] = rest / M[j, j]
            elif rest > _DEPENDENT:
                M[i, i] = sqrt(rest)
            else:
                return False
    return True


@part
def _solve(L: Array, size: int, b: Array) -> None:
    """Replace ``b`` by the solution y of L Lᵀ y = b."""
    for i in range(size):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            b[i] -= L[k, i] * b[k]
        b[i] /= L[i, i]


@part
def _starts(start: Array, x_l: Array, x_u: Array, side: NDArray[np.int64], x: Array) -> bool:
    """Write the first guess, by the minimiser without constraints; False for NaN, or bounds that cross."""
    for k in range(len(x)):
        if not (x_l[k] <= x_u[k] and np.isfinite(start[k])):
            return False
        x[k] = min(max(start[k], x_l[k]), x_u[k])
        side[k] = (start[k] > x_u[k]) - (start[k] < x_l[k])
    return True


@part
def _held_minimiser(
    P: Array,
    G: Array,
    c: Array,
    h_l: Array,
    h_u: Array,
    side: NDArray[np.int64],
    rows: NDArray[np.int64],
    sides: NDArray[np.int64],
    held: int,
    free: NDArray[np.int64],
    x: Array,
    multipliers: Array,
    L: Array,
    T: Array,
    S: Array,
) -> int:
    """Write the minimiser with the guessed bounds and rows held; return the number of free variables, or −1.

    ``T`` (n, n) holds P_FF⁻¹ G_Fᵀ, one row for each held row; ``L``, ``S`` (n, n) are scratch memory.
    """
    n, size = len(c), 0
    for k in range(n):
        if side[k] == 0:
            free[size] = k
            size += 1
    if held > size:
        return -1
    y = T[n]
    for a in range(size):
        y[a] = -c[free[a]]
        for k in range(n):
            if side[k] != 0:
                y[a] -= P[free[a], k] * x[k]
        for b in range(a + 1):
            L[a, b] = P[free[a], free[b]]
    if not _factor(L, size):
        return -1
    _solve(L, size, y)
    for a in range(size):
        x[free[a]] = y[a]
    for r in range(held):
        row, t = rows[r], T[r]
        missing = h_l[row] if sides[r] < 0 else h_u[row]
        for k in range(n):
            missing -= G[row, k] * x[k]
        multipliers[r] = -missing
        for a in range(size):
            t[a] = G[row, free[a]]
        _solve(L, size, t)
        for q in range(r + 1):
            S[r, q] = 0.0
            for a in range(size):
                S[r, q] += G[rows[q], free[a]] * t[a]
    if held > 0:
        if not _factor(S, held):
            return -1
        _solve(S, held, multipliers)
        for r in range(held):
            for a in range(size):
                x[free[a]] -= multipliers[r] * T[r, a]
    return size


@part
def _gradient(
    P: Array, G: Array, c: Array, x: Array, rows: NDArray[np.int64], multipliers: Array, held: int, k: int
) -> float:
    """Return entry ``k`` of P x + c + Gᵀ multipliers, over the ``held`` rows."""
    total = c[k]
    for j in range(len(x)):
        total += P[k, j] * x[j]
    for r in range(held):
        total += G[rows[r], k] * multipliers[r]
    return float(total)


@part
def _worst(G: Array, h_l: Array, h_u: Array, x: Array) -> int:
    """Return 1 + the most violated row, negative if its lower bound is violated; 0 if all rows hold."""
    worst, most = 0, _TOLERANCE
    for r in range(len(G)):
        value = 0.0
        for k in range(len(x)):
            value += G[r, k] * x[k]
        if not (h_l[r] - value <= most):
            worst, most = -1 - r, h_l[r] - value
        if not (value - h_u[r] <= most):
            worst, most = 1 + r, value - h_u[r]
    return worst


@part
def _follow_rows(
    G: Array,
    x_l: Array,
    x_u: Array,
    h_l: Array,
    h_u: Array,
    x: Array,
    side: NDArray[np.int64],
    rows: NDArray[np.int64],
    sides: NDArray[np.int64],
) -> int:
    """Hold the rows that ``x`` breaks, step by step, each by the last variable that it depends on.

    G consists of triangular blocks (n, n): row r depends on the variables up to r mod n, as speed and place
    after a step depend on the accelerations up to it. Such a variable becomes free if its bounds allow it,
    and ``x`` changes. Returns the number of held rows.
    """
    n, held = len(x), 0
    for k in range(n):
        for r in range(k, len(G), n):
            value = 0.0
            for j in range(k + 1):
                value += G[r, j] * x[j]
            low, high = h_l[r] - _TOLERANCE, h_u[r] + _TOLERANCE
            if low <= value <= high or G[r, k] == 0.0:
                continue
            new = x[k] + ((h_l[r] if value < low else h_u[r]) - value) / G[r, k]
            if x_l[k] <= new <= x_u[k]:
                x[k], side[k] = new, 0
                rows[held], sides[held] = r, -1 if value < low else 1
                held += 1
                break
    return held


@kernel(
    INT,
    *[array(2)] * 8,
    INT,
    output(2),
    *[output(2, INT)] * 4,
    *[output(2)] * 4,
)
def working_sets(
    P: Array,
    G: Array,
    minimiser: Array,
    c: Array,
    x_l: Array,
    x_u: Array,
    h_l: Array,
    h_u: Array,
    which: int,
    x: Array,
    sizes: NDArray[np.int64],
    free: NDArray[np.int64],
    rows: NDArray[np.int64],
    sides: NDArray[np.int64],
    reduced_P: Array,
    reduced_c: Array,
    reduced_A: Array,
    reduced_b: Array,
) -> int:
    """Guess what binds in each of K QPs min ½ xᵀPx + cᵀx, x_l ≤ x ≤ x_u, h_l ≤ G x ≤ h_u.

    This is done for the QPs whose bit is set in ``which``; returned are the bits of those without a result.
    ``minimiser`` (n, n) is −P⁻¹; c, x_l, x_u (K, n); h_l, h_u (K, m). Written are the minimisers ``x`` (K, n)
    and ``sizes`` (K, 2), the numbers of free variables and of held rows, or −1 in the first place without a
    result; the free variables ``free`` (K, n) and the held ``rows`` (K, n), with ``sides`` (K, n): 1 where a
    row holds its upper bound, −1 for the lower. The QP of the free variables is
    min ½ yᵀ reduced_P y + reduced_cᵀ y, reduced_A y = reduced_b, each matrix (K, n²) column by column.
    """
    n = len(P)
    L, T, S = np.empty((n, n)), np.empty((n + 1, n)), np.empty((n, n))
    side, multipliers, start = np.empty(n, np.int64), np.empty(n), np.empty(n)
    missing = 0
    for i in range(len(c)):
        if not which >> i & 1:
            continue
        sizes[i, 0], sizes[i, 1] = -1, 0
        missing |= 1 << i
        for k in range(n):
            start[k] = 0.0
            for j in range(n):
                start[k] += minimiser[k, j] * c[i, j]
        if not _starts(start, x_l[i], x_u[i], side, x[i]):
            continue
        held, size, settled, followed = 0, -1, False, False
        for step in range(_MAX_STEPS):
            size = _held_minimiser(
                P, G, c[i], h_l[i], h_u[i], side, rows[i], sides[i], held, free[i], x[i], multipliers, L, T, S
            )
            if size < 0:
                break
            changed = False
            for k in range(n):
                new = side[k]
                if side[k] == 0:
                    new = (x[i, k] > x_u[i, k] + _TOLERANCE) - (x[i, k] < x_l[i, k] - _TOLERANCE)
                elif side[k] * _gradient(P, G, c[i], x[i], rows[i], multipliers, held, k) > _TOLERANCE:
                    new = 0
                if new != side[k]:
                    side[k], changed = new, True
                    if step >= _TOGETHER:
                        break
            for k in range(n):
                if side[k] != 0:
                    x[i, k] = x_l[i, k] if side[k] < 0 else x_u[i, k]
            if not changed:
                for r in range(held - 1, -1, -1):
                    if multipliers[r] * sides[i, r] < -_TOLERANCE:
                        held, changed = held - 1, True
                        rows[i, r], sides[i, r] = rows[i, held], sides[i, held]
                        break
            if not changed:
                worst = _worst(G, h_l[i], h_u[i], x[i])
                if worst == 0:
                    settled = True
                    break
                if not followed:
                    followed = True
                    held = _follow_rows(G, x_l[i], x_u[i], h_l[i], h_u[i], x[i], side, rows[i], sides[i])
                    if held > 0:
                        continue
                if held == n:
                    break
                row = abs(worst) - 1
                if held == size:
                    # No variable is free to keep one row more: the last one of those that the row depends on.
                    side[row % n] = 0
                rows[i, held], sides[i, held] = row, 1 if worst > 0 else -1
                held += 1
        if not settled:
            continue
        sizes[i, 0], sizes[i, 1] = size, held
        missing ^= 1 << i
        for a in range(size):
            reduced_c[i, a] = c[i, free[i, a]]
            for k in range(n):
                if side[k] != 0:
                    reduced_c[i, a] += P[free[i, a], k] * x[i, k]
            for b in range(size):
                reduced_P[i, a * size + b] = P[free[i, a], free[i, b]]
        for r in range(held):
            row = rows[i, r]
            reduced_b[i, r] = h_l[i, row] if sides[i, r] < 0 else h_u[i, row]
            for k in range(n):
                if side[k] != 0:
                    reduced_b[i, r] -= G[row, k] * x[i, k]
            for a in range(size):
                reduced_A[i, a * held + r] = G[row, free[i, a]]
    return missing


@kernel(
    INT,
    *[array(2)] * 7,
    INT,
    *[array(2, INT)] * 4,
    *[array(2)] * 2,
    output(2),
)
def verified(
    P: Array,
    G: Array,
    c: Array,
    x_l: Array,
    x_u: Array,
    h_l: Array,
    h_u: Array,
    which: int,
    sizes: NDArray[np.int64],
    free: NDArray[np.int64],
    rows: NDArray[np.int64],
    sides: NDArray[np.int64],
    y: Array,
    multipliers: Array,
    x: Array,
) -> int:
    """Write the solutions ``y`` (K, n) of reduced QPs to ``x`` (K, n); return the bits of the minimisers.

    This is done for the QPs whose bit is set in ``which``. A bit is set in the result if x fulfils the
    optimality conditions of the whole QP: bounds and rows to ``_KEPT``, the gradient and the signs of the
    ``multipliers`` (K, n) of the held rows to ``_BALANCED`` of the largest entry of c.
    """
    n, bits = len(P), 0
    for i in range(len(c)):
        if not which >> i & 1:
            continue
        size, held = sizes[i, 0], sizes[i, 1]
        for a in range(size):
            x[i, free[i, a]] = y[i, a]
        most, good, a = 1.0, True, 0
        for k in range(n):
            most = max(most, abs(c[i, k]))
        for r in range(held):
            good = good and multipliers[i, r] * sides[i, r] >= -_BALANCED * most
        for k in range(n):
            slope = _gradient(P, G, c[i], x[i], rows[i], multipliers[i], held, k) / most
            if a < size and free[i, a] == k:
                a += 1
                good = good and abs(slope) <= _BALANCED
                good = good and x[i, k] >= x_l[i, k] - _KEPT and x[i, k] <= x_u[i, k] + _KEPT
            elif x[i, k] == x_l[i, k]:
                good = good and (slope >= -_BALANCED or x[i, k] == x_u[i, k])
            else:
                good = good and slope <= _BALANCED
        for r in range(len(G)):
            value = 0.0
            for k in range(n):
                value += G[r, k] * x[i, k]
            good = good and value >= h_l[i, r] - _KEPT and value <= h_u[i, r] + _KEPT
        bits |= good << i
    return bits
