"""Covariance intersection: the information of the result, and that its covariance stays positive."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.estimation.covariance_intersection import intersect
from companion.values.horizon import Array


def covariance(rng: np.random.Generator, size: int) -> Array:
    """A covariance (size, size) whose axes differ by up to a factor of 30, in any direction."""
    turn, _ = np.linalg.qr(rng.normal(size=(size, size)))
    scales = 10.0 ** rng.uniform(-1.5, 1.5, size)
    result: Array = turn @ np.diag(scales) @ turn.T
    return 0.5 * (result + result.T)


@given(st.integers(0, 2**32 - 1), st.sampled_from([3, 9]))
def test_the_result_has_the_shares_of_both_informations(seed: int, size: int) -> None:
    """Of the place, and the rest of the state follows as by a Kalman update with P/ω and R/(1 − ω)."""
    rng = np.random.default_rng(seed)
    before, R = covariance(rng, size), covariance(rng, 3)
    P, B, S = before.copy(), before[:, :3].copy(), np.empty((3, 3))
    if not intersect(P, R, B, S):
        assert (before == P).all()
        return
    share = before[0, 0] / P[0, 0]
    assert 0.0 < share < 1.0
    assert pytest.approx(S) == before[:3, :3] / share + R / (1.0 - share)
    after = P - B @ np.linalg.inv(S) @ B.T
    information = share * np.linalg.inv(before[:3, :3]) + (1.0 - share) * np.linalg.inv(R)
    assert after[:3, :3] @ information == pytest.approx(np.eye(3), abs=1e-6)
    assert np.linalg.eigvalsh(after).min() > 0.0


def test_two_long_ellipses_that_cross_leave_a_small_one() -> None:
    P = np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.0], [0.0, 0.0, 1.0]])
    R = P * np.array([[1.0, -1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
    B, S = P.copy(), np.empty((3, 3))
    assert intersect(P, R, B, S)
    after = P - B @ np.linalg.inv(S) @ B.T
    assert np.diag(after)[:2] == pytest.approx([0.19, 0.19], abs=0.01)
