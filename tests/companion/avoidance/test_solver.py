"""What PIQP would not say itself: wrong sizes, NaN, no solution; and that results are copies."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from companion.avoidance.solver import QpSolver
from companion.errors import CompanionError, ShapeError, SolverError
from tests.companion.rig import LAWS, vectors

WIDE = np.full(3, 1e3)
ROW = np.array([[1.0, 1.0, 1.0]])


def solver():
    return QpSolver(np.diag([1.0, 2.0, 4.0]), ROW)


def solve(qp, c=(0.0, 0.0, 0.0), low=-WIDE, high=WIDE, h_l=(-1e3,), h_u=(1e3,)):
    return qp.solve(np.array(c), low, high, np.array(h_l), np.array(h_u))


@LAWS
@given(c=vectors(50.0))
def test_far_from_its_bounds_it_is_the_unconstrained_minimum(c):
    np.testing.assert_allclose(solve(solver(), c), -c / [1.0, 2.0, 4.0], atol=1e-6)


@LAWS
@given(c=vectors(50.0))
def test_separable_bounds_clip(c):
    qp = QpSolver(np.diag([1.0, 2.0, 4.0]))
    x = qp.solve(c, np.full(3, -1.0), np.full(3, 2.0))
    np.testing.assert_allclose(x, np.clip(-c / [1.0, 2.0, 4.0], -1.0, 2.0), atol=1e-5)


def test_a_result_survives_the_next_solve():
    qp = solver()
    first = solve(qp, (1.0, 0.0, 0.0))
    kept = first.copy()
    solve(qp, (-9.0, 5.0, 3.0))
    np.testing.assert_array_equal(first, kept)


@pytest.mark.parametrize(
    "sizes", [(2, 3, 3, 1, 1), (3, 4, 3, 1, 1), (3, 3, 0, 1, 1), (3, 3, 3, 2, 1), (3, 3, 3, 1, 0)]
)
def test_wrong_sizes_are_refused_and_leave_the_solver_as_it_was(sizes):
    qp = solver()
    expected = solve(qp, (1.0, 2.0, 3.0))
    c, x_l, x_u, h_l, h_u = (np.zeros(size) for size in sizes)
    with pytest.raises(ShapeError):
        qp.solve(c, x_l, x_u, h_l, h_u)
    np.testing.assert_array_equal(solve(qp, (1.0, 2.0, 3.0)), expected)


def test_missing_rows_are_refused():
    with pytest.raises(ShapeError):
        solver().solve(np.zeros(3), -WIDE, WIDE)


@pytest.mark.parametrize("place", range(5))
def test_a_nan_is_refused_and_leaves_the_solver_as_it_was(place):
    qp = solver()
    expected = solve(qp, (1.0, 2.0, 3.0))
    vectors = [np.ones(3), -np.ones(3), np.ones(3), -np.ones(1), np.ones(1)]
    vectors[place][-1] = np.nan
    with pytest.raises(ShapeError):
        qp.solve(*vectors)
    np.testing.assert_array_equal(solve(qp, (1.0, 2.0, 3.0)), expected)


def test_no_solution_is_an_error_that_carries_the_status():
    qp = solver()
    with pytest.raises(SolverError) as caught:
        solve(qp, low=np.full(3, 1.0), high=np.full(3, 2.0), h_l=(-2.0,), h_u=(-1.0,))
    assert isinstance(caught.value, CompanionError)
    assert caught.value.status.startswith("PIQP_")
    assert caught.value.status != "PIQP_SOLVED"
    assert caught.value.iterations > 0
    assert caught.value.status in str(caught.value)
    # The next problem is solved as if nothing had happened.
    np.testing.assert_allclose(solve(qp, (1.0, 2.0, 4.0)), [-1.0, -1.0, -1.0], atol=1e-6)


def test_too_few_iterations_are_an_error_and_not_half_a_plan():
    qp = QpSolver(np.eye(3), ROW, max_iter=1)
    with pytest.raises(SolverError) as caught:
        solve(qp, (100.0, -3.0, 7.0), h_l=(1.0,), h_u=(2.0,))
    assert "MAX_ITER" in caught.value.status
