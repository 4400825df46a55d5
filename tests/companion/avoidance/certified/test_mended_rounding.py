"""A rounded plan that breaks planes by little is changed by units of the wire, until it keeps them."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.committed import accelerations_of, controls, rests
from companion.avoidance.certified.mended_rounding import MOST_UNITS, mended
from companion.avoidance.certified.separating_planes import Planes, kept
from companion.values.horizon import Array
from mavlink_bridge.wire.plan import WirePlan
from tests.companion.avoidance.certified.plans import STEPS, random_plan

HERE = np.array([0.0, 0.0, 5.0])
seeds = st.integers(0, 2**32 - 1)


def behind(plan: WirePlan, normals: Array, short: Array) -> Planes:
    """Planes with ``normals`` (M, n, 3) that the plan breaks by ``short`` (M, n, 3), m, where it is > 0."""
    least = np.einsum("mki,kji->mkj", normals, controls(plan)) + short
    # What the beginning determines is kept by any plan.
    least[:, 0, :2] -= 1.0
    return Planes(normals, least, least)


def unit(vectors: Array) -> Array:
    result: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return result


@given(seeds, st.integers(1, 3))
def test_it_keeps_all_planes_and_differs_by_few_units(seed: int, obstacles: int) -> None:
    """Of obstacles on one side, broken at single control points by less than the rounding moves these."""
    rng = np.random.default_rng(seed)
    plan = random_plan(rng, HERE)
    aside = unit(rng.normal(size=3))
    normals = unit(aside + 0.2 * rng.normal(size=(obstacles, STEPS, 3)))
    short = np.where(rng.random((obstacles, STEPS, 3)) < 0.2, rng.uniform(0.0, 2e-5), -1e-3)
    planes = behind(plan, normals, short)
    better = mended(plan, planes)
    assert better is not None
    assert kept(planes, controls(better))
    assert rests(better)
    assert better._replace(accelerations=plan.accelerations) == plan
    assert np.abs(accelerations_of(better) - accelerations_of(plan)).max() <= MOST_UNITS


@given(seeds)
def test_a_plan_that_keeps_all_planes_stays_as_it_is(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plan = random_plan(rng, HERE)
    normals = unit(rng.normal(size=(2, STEPS, 3)))
    assert mended(plan, behind(plan, normals, np.full((2, STEPS, 3), -1e-9))) == plan


def test_between_planes_that_face_each_other_there_is_none() -> None:
    plan = random_plan(np.random.default_rng(1), HERE)
    normals = np.zeros((2, STEPS, 3))
    normals[0, :, 0], normals[1, :, 0] = 1.0, -1.0
    assert mended(plan, behind(plan, normals, np.full((2, STEPS, 3), 1e-6))) is None
