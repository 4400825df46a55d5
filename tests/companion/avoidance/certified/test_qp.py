"""The first step of the proof: the committed plan solves every problem. And what a QP promises: all rows are
kept, and no plan that keeps them costs less."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import daqp
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from companion.avoidance.certified.committed import committed, controls, rests
from companion.avoidance.certified.qp import Answer, Objective, SeparationQp, State
from companion.config.planning import LimitsConfig
from companion.errors import CompanionError
from companion.values.horizon import Array
from tests.companion.avoidance.certified.plans import STEPS
from tests.companion.avoidance.certified.scenes import (
    CONFIG,
    LOPSIDED,
    NARROW,
    SMOOTH,
    WIDE,
    Scene,
    beyond,
    cost,
    flown,
    jam,
    residuals,
    scene,
    widened,
)

CLOSE = 1e-5
"""m, m/s, m/s²."""
seeds = st.integers(0, 2**32 - 1)
bounded = [scene, *(partial(scene, limits=limits) for limits in (NARROW, SMOOTH, LOPSIDED))]
kinds = st.sampled_from([*bounded, jam])


def solved(s: Scene, which: int = 0) -> Answer:
    return s.program().solve(s.state, s.wishes[which], s.planes)


@given(seeds, kinds)
def test_the_committed_plan_keeps_its_own_problem(seed: int, kind: Callable[[int], Scene]) -> None:
    """Its planes hold with no widening at all: that is step one of the proof."""
    s = kind(seed)
    planes = s.planes.wanted.size
    assert beyond(s, s.state.committed)[:planes].max(initial=-1.0) <= 1e-12
    assert not np.abs(flown(s, s.state.committed)[1][-1]).max() > 1e-12


@given(seeds, kinds)
def test_every_problem_is_solved_and_its_solution_keeps_all_rows(
    seed: int, kind: Callable[[int], Scene]
) -> None:
    """Whatever the committed plan breaks: limits of place, speed and acceleration, least distances."""
    s = kind(seed)
    answer = solved(s)
    assert (beyond(s, answer.accelerations) - widened(s)).max() <= CLOSE
    assert np.abs(flown(s, answer.accelerations)[1][-1]).max() <= CLOSE


@pytest.mark.parametrize("seed", [3116, 6514, 9760, 21895])
def test_so_is_a_problem_without_an_interior(seed: int) -> None:
    """These take an interior-point method three times as long as others."""
    s = scene(seed, NARROW)
    assert (beyond(s, solved(s).accelerations) - widened(s)).max() <= CLOSE


@given(seeds, kinds)
def test_what_is_committed_of_a_solution_rests_and_is_within_the_limits(
    seed: int, kind: Callable[[int], Scene]
) -> None:
    """Rounding, and the last knot that takes up all the others' rounding, break no bound of acceleration."""
    s = kind(seed)
    plan = committed(s.start, solved(s).accelerations)
    assert rests(plan)
    before, after = s.state.committed, plan.accelerations_m_s2
    low, high = np.minimum(s.limits.least_u, before), np.maximum(s.limits.u_max, before)
    if s.limits is WIDE:
        assert (after >= low - 1e-9).all()
        assert (after <= high + 1e-9).all()
    # Knot by knot where bounds were broken: all but the last are rounded by no more than half a unit.
    assert (after[:-1] >= low[:-1] - 0.51e-3).all()
    assert (after[:-1] <= high[:-1] + 0.51e-3).all()
    # Half a unit an input, over sixteen knots, is millimetres.
    points = flown(s, solved(s).accelerations)[0]
    assert np.abs(controls(plan) - points).max() < CONFIG.spare


@given(seeds, kinds)
def test_the_solution_costs_no_more_than_the_committed_plan(seed: int, kind: Callable[[int], Scene]) -> None:
    s = kind(seed)
    stays = cost(s, s.wishes[0], s.state.committed)
    assert cost(s, s.wishes[0], solved(s).accelerations) <= stays * (1.0 + 1e-6) + 1e-6


@given(seeds)
def test_of_plans_that_keep_the_same_rows_each_is_the_best_for_its_own_wish(seed: int) -> None:
    """So are all that lie between them: the cost does not fall from the solution towards any other."""
    s = scene(seed, wishes=4)
    plans = [solved(s, which).accelerations for which in range(len(s.wishes))]
    for wish, best in zip(s.wishes, plans, strict=True):
        least = cost(s, wish, best)
        for other in plans:
            for share in (1e-2, 1.0):
                there = best + share * (other - best)
                assert cost(s, wish, there) >= least * (1.0 - 1e-6) - 1e-6


@pytest.mark.parametrize(
    "kind",
    bounded,
    ids=["wide", "narrow", "smooth", "lopsided"],
)
def test_another_solver_with_all_rows_finds_the_same_plan(kind: Callable[[int], Scene]) -> None:
    """Of a problem that is written down anew, by what the motion and the settings say."""
    tight = 0
    for seed in range(12):
        s = kind(seed)
        answer = solved(s)
        reference = _by_daqp(s)
        np.testing.assert_allclose(answer.accelerations, reference, rtol=0.0, atol=2e-3)
        best = cost(s, s.wishes[0], reference)
        assert cost(s, s.wishes[0], answer.accelerations) == pytest.approx(best, rel=1e-4, abs=1e-4)
        tight += bool(np.linalg.norm(answer.forces) > 1e-3)
    assert tight >= 3


def _by_daqp(s: Scene) -> Array:
    shape, size = s.state.committed.shape, s.state.committed.size
    inset = np.zeros(beyond(s, s.state.committed).shape)
    inset[-2 * size :] = 0.01
    """Bounds are tighter than u_max, for rounding, unless the committed plan is beyond them."""
    zero, units = np.zeros(shape), np.eye(size).reshape(size, *shape)
    r0, b0 = residuals(s, s.wishes[0], zero), beyond(s, zero) + inset
    M = np.stack([residuals(s, s.wishes[0], unit) - r0 for unit in units], axis=1)
    G = np.stack([beyond(s, unit) + inset - b0 for unit in units], axis=1)
    V = np.stack([flown(s, unit)[1][-1] - flown(s, zero)[1][-1] for unit in units], axis=1)
    at_most = np.maximum(beyond(s, s.state.committed) + inset, 0.0) - b0
    still = -flown(s, zero)[1][-1]
    x, _, flag, _ = daqp.solve(
        2.0 * M.T @ M,
        2.0 * M.T @ r0,
        np.ascontiguousarray(np.vstack([G, V])),
        np.concatenate([at_most, still]),
        np.concatenate([np.full(len(at_most), -1e30), still]),
        np.array([0] * len(at_most) + [5] * 3, dtype=np.int32),
    )
    assert flag == 1
    result: Array = x.reshape(shape)
    return result


@given(seeds, kinds)
def test_equal_problems_have_equal_solutions_to_the_last_bit(seed: int, kind: Callable[[int], Scene]) -> None:
    first, second = (solved(kind(seed)) for _ in range(2))
    assert first.accelerations.tobytes() == second.accelerations.tobytes()
    assert first.forces.tobytes() == second.forces.tobytes()
    assert first.rounds == second.rounds


@given(seeds)
def test_a_lopsided_problem_in_a_mirror_has_the_mirrored_plan(seed: int) -> None:
    """Least and largest values change places with their signs."""
    s = scene(seed, LOPSIDED)
    low, high = (tuple(-value for value in bounds) for bounds in (LOPSIDED.box_max, LOPSIDED.box_min))
    turned = LimitsConfig(
        u_max=tuple(-value for value in LOPSIDED.least_u),
        u_min=tuple(-value for value in LOPSIDED.u_max),
        v_max=tuple(-value for value in LOPSIDED.least_v),
        v_min=tuple(-value for value in LOPSIDED.v_max),
        box_min=low,
        box_max=high,
    )
    state, wish = State(*(-part for part in s.state)), s.wishes[0]
    mirrored = Objective(-wish.places, -wish.velocities, -wish.field, wish.moving)
    planes = s.planes._replace(normals=-s.planes.normals)
    answer = SeparationQp(STEPS, turned, CONFIG).solve(state, mirrored, planes)
    np.testing.assert_allclose(-answer.accelerations, solved(s).accelerations, rtol=0.0, atol=2e-3)


@given(seeds)
def test_the_push_is_what_planes_that_move_cost(seed: int) -> None:
    """If the planes of some obstacles move by d, the least cost grows by F·d at least: it is convex in d."""
    s = scene(seed)
    answer = solved(s)
    here = cost(s, s.wishes[0], answer.accelerations)
    rng = np.random.default_rng(seed)
    way = 1e-2 * rng.normal(size=3)
    some = (rng.uniform(size=len(s.planes.wanted)) < 0.5).astype(np.float64)
    for d in (way, -way):
        shift = some[:, None] * (s.planes.normals @ d)
        moved = s.planes._replace(wanted=s.planes.wanted + shift[..., None])
        try:
            there = s.program().solve(s.state, s.wishes[0], moved)
        except CompanionError:
            # The planes leave no plan.
            continue
        growth = cost(s, s.wishes[0], there.accelerations) - here
        assert growth >= some @ answer.forces @ d - 1e-5 * (1.0 + here)


@given(seeds)
@example(0)
def test_a_program_remembers_nothing(seed: int) -> None:
    program = scene(seed).program()
    first, other = scene(seed), scene(seed + 1)
    alone = program.solve(first.state, first.wishes[0], first.planes)
    program.solve(other.state, other.wishes[0], other.planes)
    again = program.solve(first.state, first.wishes[0], first.planes)
    assert alone.accelerations.tobytes() == again.accelerations.tobytes()


def test_what_is_not_finite_is_no_plan() -> None:
    s = scene(0)
    nowhere = s.wishes[0]._replace(places=np.full_like(s.wishes[0].places, np.nan))
    with pytest.raises(CompanionError):
        s.program().solve(s.state, nowhere, s.planes)


def room(s: Scene) -> Array:
    """Distance (M, n, 3), m, of the committed plan's control points from its planes."""
    result: Array = np.einsum("mnk,nik->mni", s.planes.normals, controls(s.start)) - s.planes.least
    return result


def test_the_scenes_are_hard_ones() -> None:
    """Some committed plans break what they can; many solutions lean on planes: else the laws are idle."""
    scenes = [scene(seed, limits) for seed in range(40) for limits in (WIDE, NARROW, SMOOTH)]
    assert sum(widened(s).max() > 0.1 for s in scenes) > 30
    assert sum(bool((np.abs(room(s)) < 1e-12).any()) for s in scenes) > 10
    assert sum(np.linalg.norm(solved(s).forces) > 1e-3 for s in scenes) > 30


@pytest.mark.parametrize(("planar", "a", "jerk"), [(True, 0.05, 0.3), (False, 0.02, 0.2)])
def test_without_settings_the_weights_of_a_and_its_change_suit_the_plane_or_space(
    planar: bool, a: float, jerk: float
) -> None:
    """Settings hold for both."""

    def matrix(**chosen: float) -> Array:
        config = CONFIG.model_copy(update=chosen)
        return SeparationQp(STEPS, WIDE, config, planar=planar).costs[False].P

    assert (matrix() == matrix(omega_input=a, omega_jerk=jerk)).all()
    for other in (matrix(omega_input=2.0 * a), matrix(omega_jerk=2.0 * jerk)):
        assert (matrix() != other).any()
