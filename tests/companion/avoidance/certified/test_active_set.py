"""Rows that bind: the QP with these rows alone has the minimiser of the QP with all rows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.active_set import binding_rows
from companion.avoidance.solver import solve_once
from companion.errors import SolverError

seeds = st.integers(0, 2**32 - 1)


@given(seeds)
def test_the_binding_rows_determine_the_minimiser(seed: int) -> None:
    """All QPs have a point inside: the minimiser exists, and is unique."""
    rng = np.random.default_rng(seed)
    size, rows = int(rng.integers(2, 20)), int(rng.integers(1, 60))
    root = rng.normal(size=(size, size))
    P = root @ root.T + np.eye(size)
    c, inside = 3.0 * rng.normal(size=size), rng.normal(size=size)
    G = rng.normal(size=(rows, size))
    low = G @ inside - rng.uniform(0.1, 2.0, rows)
    x_min, x_max = inside - rng.uniform(0.1, 2.0, size), inside + rng.uniform(0.1, 2.0, size)
    A, b = np.zeros((0, size)), np.zeros(0)
    found = np.empty(size, np.int64)
    H = np.linalg.inv(P)
    count = binding_rows(H, -H @ c, np.ascontiguousarray(G.T), low, x_min, x_max, found)
    assert count >= 0
    chosen = np.sort(found[:count])
    whole = solve_once(P, c, A, b, G, low, x_min, x_max)
    part = solve_once(P, c, A, b, G[chosen], low[chosen], x_min, x_max)
    # The solver stops at a duality gap; the Hessian's curvature is at least 1, so this is a distance.
    gap = 1e-9 * (1.0 + abs(0.5 * whole.x @ P @ whole.x + c @ whole.x))
    near = 2.0 * np.sqrt(2.0 * gap)
    np.testing.assert_allclose(part.x, whole.x, atol=near)
    slack = (G @ whole.x - low) / np.linalg.norm(G, axis=1)
    assert set(np.flatnonzero(whole.multipliers > 1e-3)) <= set(chosen) <= set(np.flatnonzero(slack < near))


def test_rows_that_contradict_each_other_have_no_minimiser() -> None:
    G, low = np.array([[1.0], [-1.0]]), np.array([1.0, 0.0])
    args = np.eye(1), np.zeros(1), np.ascontiguousarray(G.T), low, -np.ones(1) * 9, np.ones(1) * 9
    assert binding_rows(*args, np.empty(1, np.int64)) == -1
    with pytest.raises(SolverError):
        solve_once(np.eye(1), np.zeros(1), np.zeros((0, 1)), np.zeros(0), G, low, -np.ones(1), np.ones(1))
