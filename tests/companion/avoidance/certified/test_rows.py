"""Rows of the certified QP: slacks and matrix agree, are those of the motion, and those left out hold."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from companion.avoidance.certified.rows import BOUND, row_slacks, rows_within, write_rows
from companion.values.horizon import Array
from companion.values.prediction import prediction

DT = 0.1
draws = given(st.integers(0, 2**32 - 1), st.integers(2, 16), st.integers(0, 4), st.sampled_from([0.1, 1, 30]))


class Drawn(NamedTuple):
    """State, committed accelerations, limits and planes."""

    position: Array
    velocity: Array
    before: Array
    committed: Array
    ranges: Array
    normals: Array
    wanted: Array
    a_range: Array
    change: Array

    def slack(self, a: Array) -> Array:
        """Slack (R,) of all rows, by the motion with accelerations (n, 3) itself."""
        moved, relaxed = self._moved(a), self._moved(self.committed)
        points, speeds = moved
        changes = -self.change, self.change
        limits = []
        for part, (least, most), there in (
            (speeds, self.ranges[1], relaxed[1]),
            (points[:, 1], self.ranges[0], relaxed[0][:, 1]),
            (points[:, 2], self.ranges[0], relaxed[0][:, 2]),
            (np.diff(a, axis=0), changes, np.diff(self.committed, axis=0)),
        ):
            limits += [part - np.minimum(least, there), np.maximum(most, there) - part]
        planes = np.einsum("mnk,nik->mni", self.normals, points) - self.wanted
        planes[:, 0, 0] = np.inf
        return np.concatenate([planes.ravel(), *(part.ravel() for part in limits)])

    def _moved(self, a: Array) -> tuple[Array, Array]:
        """Control points (n, 3, 3) and velocities (n, 3) after the steps."""
        speeds = self.velocity + DT * np.cumsum(a, axis=0)
        before = np.vstack([self.velocity, speeds[:-1]])
        ends = self.position + np.cumsum(DT * before + 0.5 * DT * DT * a, axis=0)
        begins = np.vstack([self.position, ends[:-1]])
        return np.stack([begins, begins + 0.5 * DT * before, ends], axis=1), speeds


class Rows(NamedTuple):
    planes: int
    of: NDArray[np.int64]
    c: Array
    low: Array
    whose: NDArray[np.int64]
    x_min: Array
    x_max: Array


def draw(seed: int, n: int, count: int, size: float) -> Drawn:
    rng = np.random.default_rng(seed)
    ranges = np.sort(size * rng.normal(size=(2, 2, 3)), axis=1)
    normals, wanted = rng.normal(size=(2, count, n, 3))
    state, committed = rng.normal(size=(3, 3)), rng.normal(size=(n, 3))
    most, least, change = rng.uniform(0.1, 2.0, (3, 3))
    a_range = np.stack([-least, most])
    change[rng.uniform(size=3) < 0.5] = np.inf
    return Drawn(*state, committed, ranges, normals, size * wanted, a_range, change)


def written(drawn: Drawn) -> Rows:
    n = len(drawn.committed)
    most, bounds = 24 * n + drawn.wanted.size, np.empty((2, 3, n))
    rows = np.empty(most, np.int64), np.empty((most, 3)), np.empty(most)
    whose = np.empty(drawn.wanted.size, np.int64)
    planes, count = rows_within(*drawn[:3], DT, *drawn[3:], bounds[0], bounds[1], *rows, whose)
    of, c, low = (part[:count] for part in rows)
    return Rows(planes, of, c, low, whose[:planes], *bounds)


@draws
def test_slacks_are_those_of_the_motion_and_of_the_matrix(seed: int, n: int, count: int, size: float) -> None:
    drawn = draw(seed, n, count, size)
    rows = written(drawn)
    a = np.random.default_rng(seed + 1).normal(size=(n, 3))
    slack = np.empty(len(rows.low))
    row_slacks(np.ascontiguousarray(a.T), DT, rows.of, rows.c, rows.low, slack)
    S_v, S_x, _ = prediction(n, DT)
    v, x = (np.vstack([np.zeros((1, n)), part[:-1]]) for part in (S_v, S_x))
    G = np.empty((len(rows.low), 3, n))
    maps = np.stack([x, x + 0.5 * DT * v, S_x, S_v, np.eye(n) - np.eye(n, k=-1)])
    write_rows(np.arange(len(rows.low)), rows.of, rows.c, maps, G)
    np.testing.assert_allclose(np.einsum("rij,ji->r", G, a) - rows.low, slack, rtol=0.0, atol=1e-10)
    every = drawn.slack(a)
    for one in slack:
        assert np.abs(every - one).min() < 1e-9
    of_planes = every[: drawn.wanted.size].reshape(drawn.wanted.shape)
    for one, m in zip(slack[: rows.planes], rows.whose, strict=True):
        assert np.abs(of_planes[m] - one).min() < 1e-9


@draws
def test_what_is_left_out_holds_for_all_accelerations_within_their_bounds(
    seed: int, n: int, count: int, size: float
) -> None:
    """Each row of the motion is written, or the plan that is worst for it keeps it."""
    drawn = draw(seed, n, count, size)
    rows, rng = written(drawn), np.random.default_rng(seed + 1)
    middle = np.zeros((n, 3))
    middle[0] = drawn.before
    for side, bound, of in ((-1.0, rows.x_min.T, 0), (1.0, rows.x_max.T, 1)):
        most = np.tile(side * drawn.a_range[of], (n, 1))
        most[[0, -1]] = np.minimum(most[[0, -1]], side * middle[[0, -1]] + drawn.change)
        np.testing.assert_array_equal(side * bound, np.maximum(most, side * drawn.committed))
    for _ in range(20):
        # Corners of the bounds are the worst; what a dual solution may violate them by counts, too.
        upper = rng.uniform(size=(n, 3)) < rng.uniform()
        if rng.uniform() < 0.5:
            upper[:] = rng.uniform(size=3) < 0.5
        a = np.where(upper, rows.x_max.T + BOUND, rows.x_min.T - BOUND)
        slack, every = np.empty(len(rows.low)), drawn.slack(a)
        row_slacks(np.ascontiguousarray(a.T), DT, rows.of, rows.c, rows.low, slack)
        violated = every[every < -1e-9]
        assert (slack < -1e-9 + 1e-10).sum() >= len(violated)
        for one in violated:
            assert np.abs(slack - one).min() < 1e-9


def test_most_rows_of_wide_limits_are_left_out_and_none_that_is_not_finite() -> None:
    drawn = draw(0, 16, 3, 30.0)
    assert len(written(drawn).low) < 0.5 * len(drawn.slack(drawn.committed))
    drawn.wanted[1, 3, 1] = np.nan
    assert np.isnan(written(drawn).low).sum() == 1
