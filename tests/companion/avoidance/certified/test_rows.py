"""Rows of the certified QP: slacks and matrix agree, and are those of the motion."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.qp_vectors import row_bounds
from companion.avoidance.certified.rows import relax_limits, row_slacks, write_rows
from companion.values.prediction import prediction


@given(st.integers(0, 2**32 - 1), st.integers(2, 16), st.integers(0, 4))
def test_slacks_are_the_rows_times_the_accelerations(seed: int, n: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    dt = 0.1
    S_v, S_x, _ = prediction(n, dt)
    v, x = (np.vstack([np.zeros((1, n)), part[:-1]]) for part in (S_v, S_x))
    maps = np.stack([x, x + 0.5 * dt * v, S_x])
    normals, wanted = rng.normal(size=(2, count, n, 3))
    position, velocity, a = rng.normal(size=3), rng.normal(size=3), rng.normal(size=(n, 3))
    limits = rng.normal(size=18 * n)
    low, slack = np.empty((2, 18 * n + 3 * count * n))
    row_bounds(position, velocity, dt, limits, normals, wanted, low)
    row_slacks(np.ascontiguousarray(a.T), dt, normals, low, slack)
    finite = np.flatnonzero(np.isfinite(low))
    assert len(low) - len(finite) == count
    G = np.empty((len(finite), 3, n))
    write_rows(finite, np.ascontiguousarray(S_v), maps, normals, G)
    np.testing.assert_allclose(np.einsum("rij,ji->r", G, a) - low[finite], slack[finite], atol=1e-12)
    # The same from the motion: speeds and control points from the state, along axes and normals.
    times = dt * (np.arange(n)[:, None] + np.array([0.0, 0.5, 1.0]))
    points = position + times[:, :, None] * velocity + np.einsum("bij,jk->ibk", maps, a)
    speeds = velocity + S_v @ a
    moved = [s * part.T.ravel() for part in (speeds, points[:, 1], points[:, 2]) for s in (1.0, -1.0)]
    planes = np.einsum("mnk,nik->mni", normals, points) - wanted
    expected = np.concatenate([np.concatenate(moved) - limits, planes.ravel()])
    np.testing.assert_allclose(slack[finite], expected[finite], atol=1e-12)
    # Limits that are violated, and they alone, are lowered until they just hold.
    relaxed = low.copy()
    relax_limits(np.ascontiguousarray(a.T), dt, relaxed)
    lowered = np.where(np.arange(len(low)) < len(limits), np.minimum(slack, 0.0), 0.0)
    np.testing.assert_allclose(relaxed[finite], (low + lowered)[finite], atol=1e-12)
