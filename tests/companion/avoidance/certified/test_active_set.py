"""What binds: the QP with these rows and bounds as equations has the minimiser of the QP with all of them."""

from __future__ import annotations

from typing import NamedTuple

import daqp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from companion.avoidance.certified.active_set import active_set, effects
from companion.avoidance.certified.minimiser import combine
from companion.avoidance.certified.rows import write_rows
from companion.values.horizon import Array
from companion.values.prediction import prediction

DT, MOST = 0.1, 64
seeds = st.integers(0, 2**32 - 1)


class Qp(NamedTuple):
    """QP of n accelerations per axis, by axis; every one has a point inside."""

    one: Array
    c: Array
    maps: Array
    of: NDArray[np.int64]
    normals: Array
    low: Array
    x_min: Array
    x_max: Array

    @property
    def start(self) -> Array:
        """Minimiser without inequalities, (3, n)."""
        result: Array = -self.c @ np.linalg.inv(self.one)
        return result


class Found(NamedTuple):
    size: int
    active: NDArray[np.int64]
    images: Array
    hessian: Array
    linear: Array

    def multipliers(self, count: int) -> Array:
        """Multipliers (count,) if only the first ``count`` constraints are held."""
        gram = self.hessian[: self.size**2].reshape(self.size, self.size)[:count, :count]
        return np.asarray(-np.linalg.solve(gram, self.linear[:count]), dtype=np.float64)


def draw(seed: int) -> Qp:
    rng = np.random.default_rng(seed)
    n, planes = int(rng.integers(2, 13)), int(rng.integers(0, 5))
    S_v, S_x, _ = prediction(n, DT)
    v, x = (np.vstack([np.zeros((1, n)), part[:-1]]) for part in (S_v, S_x))
    maps = np.stack([x, x + 0.5 * DT * v, S_x, S_v, np.eye(n) - np.eye(n, k=-1)])
    root = rng.normal(size=(n, n))
    inside = rng.normal(size=(3, n))
    # Rows of planes, and limits along an axis, of all results but the first control point.
    results = np.tile(np.arange(1, 5 * n), 6 + planes)
    normals = rng.normal(size=(len(results), 3))
    normals[: 6 * (5 * n - 1)] = np.repeat(np.vstack([np.eye(3), -np.eye(3)]), 5 * n - 1, axis=0)
    G = np.empty((len(results), 3, n))
    write_rows(np.arange(len(results)), results, normals, maps, G)
    room = rng.uniform(0.01, 0.5) * rng.uniform(0.1, 2.0, len(results))
    low: Array = np.einsum("rij,ij->r", G, inside) - room
    half = rng.uniform(0.1, 2.0, (2, 3, n))
    one = root @ root.T + np.eye(n)
    c = 10.0 * rng.normal(size=(3, n))
    return Qp(one, c, maps, results, normals, low, inside - half[0], inside + half[1])


def find(qp: Qp) -> Found:
    n = len(qp.one)
    memory = np.zeros(MOST, np.int64), np.zeros((MOST, 3, n)), np.zeros(MOST * MOST), np.zeros(MOST)
    H: Array = np.asarray(np.linalg.inv(qp.one), dtype=np.float64)
    count = active_set(*effects(H, qp.maps), qp.start, DT, *qp[3:], *memory)
    return Found(count, *memory)


def minimiser(qp: Qp) -> Array:
    """Minimiser (3, n) with all rows and bounds, by another solver."""
    n = len(qp.one)
    G = np.empty((len(qp.low), 3, n))
    write_rows(np.arange(len(qp.low)), qp.of, qp.normals, qp.maps, G)
    upper = np.concatenate([qp.x_max.ravel(), np.full(len(qp.low), 1e30)])
    lower = np.concatenate([qp.x_min.ravel(), qp.low])
    P, sense = np.kron(np.eye(3), qp.one), np.zeros(len(upper), dtype=np.int32)
    matrix = np.ascontiguousarray(G.reshape(len(qp.low), -1))
    x, _, flag, _ = daqp.solve(P, qp.c.ravel(), matrix, upper, lower, sense, primal_tol=1e-11)
    assert flag == 1
    result: Array = x.reshape(3, n)
    return result


@given(seeds)
def test_what_binds_determines_the_minimiser(seed: int) -> None:
    qp = draw(seed)
    found = find(qp)
    assert found.size >= 0
    k = found.size
    multipliers, planes = found.multipliers(k), 6 * (5 * len(qp.one) - 1)
    x, forces = np.empty_like(qp.c), np.empty((3, 3))
    whose = np.arange(planes) % 3
    rest = DT, *qp[3:], whose
    violation = combine(qp.start, found.images, multipliers, found.active, *rest, x, forces)
    assert violation < 1e-7
    np.testing.assert_allclose(x, minimiser(qp), rtol=0.0, atol=1e-5)
    first = found.active[:k] < planes
    binding = found.active[:k][first]
    pushes = multipliers[first, None] * qp.normals[binding]
    for m in range(3):
        np.testing.assert_allclose(forces[m], pushes[binding % 3 == m].sum(axis=0), atol=1e-9)


@given(seeds)
def test_another_set_is_not_taken_for_it(seed: int) -> None:
    """Without one constraint that binds it is violated, and with one too many a multiplier is negative."""
    qp = draw(seed)
    found = find(qp)
    if found.size < 1:
        return
    k = found.size - 1
    multipliers, planes = found.multipliers(k), 6 * (5 * len(qp.one) - 1)
    x, forces = np.empty_like(qp.c), np.empty((3, 3))
    whose = np.arange(planes) % 3
    rest = DT, *qp[3:], whose
    violation = combine(qp.start, found.images, multipliers, found.active, *rest, x, forces)
    assert violation > 1e-9 or np.abs(x - minimiser(qp)).max() < 1e-5
    negative = np.concatenate([multipliers, [-1.0]])
    assert combine(qp.start, found.images, negative, found.active, *rest, x, forces) == np.inf


@pytest.mark.parametrize("value", [np.nan, 3.0])
def test_a_qp_without_a_minimiser_has_no_active_set(value: float) -> None:
    """Bounds that contradict each other, and a cost that is not finite."""
    qp = draw(3)
    if np.isnan(value):
        qp.c[1, 0] = value
    else:
        qp.x_min[:], qp.x_max[:] = value, -value
    assert find(qp).size == -1
