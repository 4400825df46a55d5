"""A QP solved for its working set alone is solved as a whole: by its optimality conditions, and by another
solver."""

from __future__ import annotations

from typing import Any, NamedTuple

import daqp
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from companion.avoidance import reduced_qp
from companion.avoidance.reduced_qp import ReducedQp, Vectors
from companion.avoidance.solver import EquationSolver
from companion.errors import ShapeError, SolverError
from companion.values.horizon import Array
from companion.values.prediction import prediction
from tests.companion.rig import LAWS

N = 16
S_V, S_X, _ = prediction(N, 0.1)
SPEEDS_AND_PLACES = np.vstack([S_V, S_X])
NO_ROWS = np.zeros((0, N))
P = 2.0 * (np.eye(N) + 20.0 * np.outer(S_X[-1], S_X[-1]) + 10.0 * np.outer(S_V[-1], S_V[-1]))
seeds = st.integers(0, 2**32 - 1)


class Drawn(NamedTuple):
    """Three QPs with an interior, of which mostly bounds bind, and rows, too, if there are any."""

    qp: ReducedQp
    vectors: Vectors
    G: Array


def draw(seed: int, G: Array) -> Drawn:
    rng = np.random.default_rng(seed)
    c = rng.normal(size=(3, 1)) * 100.0 * S_X[-1] + rng.normal(size=(3, 1)) * 30.0 * S_V[-1]
    middle = rng.choice([0.0, 1.0, 3.0]) * rng.normal(size=(3, N))
    half = rng.uniform(0.1, 2.0, (3, N))
    rows = (middle + 0.5 * half * rng.uniform(-1.0, 1.0, (3, N))) @ G.T
    low, high = rows - rng.uniform(0.05, 3.0, rows.shape), rows + rng.uniform(0.05, 3.0, rows.shape)
    return Drawn(ReducedQp(P, G, 3), Vectors(c, middle - half, middle + half, low, high), G)


def oracle(drawn: Drawn, i: int) -> Array:
    v = drawn.vectors
    upper, lower = np.concatenate([v.x_u[i], v.h_u[i]]), np.concatenate([v.x_l[i], v.h_l[i]])
    sense = np.zeros(len(upper), dtype=np.int32)
    x, _, flag, _ = daqp.solve(P, v.c[i].copy(), drawn.G, upper, lower, sense, primal_tol=1e-11)
    assert flag == 1
    result: Array = x
    return result


@LAWS
@given(seeds)
@pytest.mark.parametrize("G", [NO_ROWS, SPEEDS_AND_PLACES], ids=["bounds", "rows"])
def test_it_has_the_minimiser_of_the_whole_qp(G: Array, seed: int) -> None:
    drawn = draw(seed, G)
    x = drawn.qp.solve(drawn.vectors)
    for i in range(3):
        np.testing.assert_allclose(x[i], oracle(drawn, i), rtol=0.0, atol=1e-5)


@LAWS
@given(seeds)
def test_what_the_working_set_gives_is_accurate(seed: int) -> None:
    """PIQP's error on a whole QP is up to 1e-6; without inequalities it is that of a linear system."""
    drawn = draw(seed, SPEEDS_AND_PLACES)
    guess = drawn.qp.guess(drawn.vectors, range(3))
    broken = drawn.qp.settle(drawn.vectors, guess, range(3))
    for i in set(range(3)) - set(guess.missing) - set(broken):
        np.testing.assert_allclose(guess.x[i], oracle(drawn, i), rtol=0.0, atol=1e-7)


def test_most_qps_need_no_more_than_their_working_set() -> None:
    whole = {len(G): 0 for G in (NO_ROWS, SPEEDS_AND_PLACES)}
    for seed in range(100):
        for G in (NO_ROWS, SPEEDS_AND_PLACES):
            drawn = draw(seed, G)
            guess = drawn.qp.guess(drawn.vectors, range(3))
            broken = drawn.qp.settle(drawn.vectors, guess, range(3))
            whole[len(G)] += len(guess.missing) + len(broken)
    assert whole[0] == 0
    assert whole[2 * N] < 150


@LAWS
@given(st.floats(0.0, 0.999), st.floats(30.0, 300.0), st.sampled_from([-1.0, 1.0]))
@example(0.75, 57.0, -1.0)  # The last variable reaches its bound before the last row binds.
def test_a_vehicle_on_its_way_to_a_distant_goal_accelerates_to_its_top_speed(
    share: float, distance: float, sign: float
) -> None:
    """All variables are at their bounds without the limit of speed, so that none is free to keep it."""
    top, most = 3.0, 2.0
    speed = share * top
    pull = 40.0 * (N * 0.1 * speed - distance) * S_X[-1] + 20.0 * speed * S_V[-1]
    c = sign * np.tile(pull, (3, 1))
    bounds, rows = np.full((3, N), most), np.full((3, 2 * N), np.inf)
    rows[:, :N] = top - speed
    low = np.full((3, 2 * N), -np.inf)
    low[:, :N] = -top - speed
    if sign < 0.0:
        rows, low = -low, -rows
    vectors = Vectors(c, -bounds, bounds, low, rows)
    qp = ReducedQp(P, SPEEDS_AND_PLACES, 3)
    guess = qp.guess(vectors, [0])
    assert guess.missing == qp.settle(vectors, guess, [0]) == []
    np.testing.assert_allclose(
        guess.x[0], oracle(Drawn(qp, vectors, SPEEDS_AND_PLACES), 0), rtol=0.0, atol=1e-6
    )
    assert np.max(sign * (S_V @ guess.x[0])) == pytest.approx(top - speed)


@pytest.mark.parametrize("G", [NO_ROWS, SPEEDS_AND_PLACES], ids=["bounds", "rows"])
def test_a_wrong_working_set_is_noticed(G: Array, monkeypatch: pytest.MonkeyPatch) -> None:
    """A bound that binds is forgotten, or one that does not bind is held: the QP is solved as a whole."""
    find, noticed = reduced_qp.working_sets, 0
    for way in (
        lambda vectors: (vectors.x_l - 0.3, vectors.x_u),
        lambda vectors: (vectors.x_l + 0.05, vectors.x_u),
    ):

        def misled(*args: Any, way: Any = way) -> Any:
            vectors = Vectors(*args[3:8])
            return find(*args[:4], *way(vectors), *args[6:])

        for seed in range(20):
            drawn = draw(seed, G)
            monkeypatch.setattr(reduced_qp, "working_sets", misled)
            guess = drawn.qp.guess(drawn.vectors, range(3))
            monkeypatch.undo()
            for i in drawn.qp.settle(drawn.vectors, guess, range(3)):
                guess.x[i] = drawn.qp.solve_whole(drawn.vectors, i)
                noticed += 1
            size = drawn.qp._sets.sizes[:, 0]
            for i in np.flatnonzero((size > 0) & (size < N)):
                np.testing.assert_allclose(guess.x[i], oracle(drawn, int(i)), rtol=0.0, atol=1e-5)
    assert noticed > 40


def test_a_failure_of_the_reduced_qp_leads_to_the_whole_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any) -> None:
        raise SolverError("PIQP_NUMERICS", 1)

    monkeypatch.setattr(EquationSolver, "solve", fails)
    drawn = draw(5, SPEEDS_AND_PLACES)
    x = drawn.qp.solve(drawn.vectors)
    for i in range(3):
        np.testing.assert_allclose(x[i], oracle(drawn, i), rtol=0.0, atol=1e-5)


@LAWS
@given(seeds, st.integers(0, 7))
def test_the_qps_not_asked_for_are_left_alone(seed: int, bits: int) -> None:
    drawn = draw(seed, NO_ROWS)
    guess = drawn.qp.guess(drawn.vectors, range(3))
    drawn.qp.settle(drawn.vectors, guess, range(3))
    guess.x[:] = before = np.full((3, N), 7.0)
    which = [i for i in range(3) if bits >> i & 1]
    drawn.qp.settle(drawn.vectors, guess, which)
    others = [i for i in range(3) if i not in which]
    np.testing.assert_array_equal(guess.x[others], before[others])


@pytest.mark.parametrize("name", Vectors._fields)
def test_a_nan_is_refused(name: str) -> None:
    drawn = draw(1, SPEEDS_AND_PLACES)
    poisoned = getattr(drawn.vectors, name).copy()
    poisoned[1, 3] = np.nan
    with pytest.raises(ShapeError):
        drawn.qp.solve(drawn.vectors._replace(**{name: poisoned}))


def test_rows_that_contradict_each_other_have_no_solution() -> None:
    drawn = draw(1, SPEEDS_AND_PLACES)
    v = drawn.vectors
    with pytest.raises(SolverError):
        drawn.qp.solve(v._replace(h_l=v.h_l + 1e3, h_u=v.h_u + 1e3))
