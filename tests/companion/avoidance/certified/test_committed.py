"""The plans of the proof: exact in integers, the same motion whoever carries it on, then rest."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.committed import (
    carried_on,
    committed,
    controls,
    horizon_of,
    resting,
    rests,
)
from companion.errors import CertificateError
from mavlink_bridge.wire.plan import WirePlan, pack, quantise, unpack
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS, curves, random_plan, resting_plans

knots = st.integers(0, 40)
seeds = st.integers(0, 2**32 - 1)
coordinate = st.floats(-500.0, 500.0)


@given(resting_plans)
def test_rest_is_exact_in_integers(plan: WirePlan) -> None:
    assert rests(plan)
    assert not plan.states()[-1, 1].any()
    x, y, z = plan.velocity
    assert not rests(plan._replace(velocity=(x, y, z + 1)))


@given(resting_plans)
def test_a_plan_is_one_that_comes_to_rest_before_it_is_carried_on(plan: WirePlan) -> None:
    x, y, z = plan.velocity
    with pytest.raises(CertificateError):
        carried_on(plan._replace(velocity=(x - 1, y, z)), 1)


@given(resting_plans, knots, knots)
def test_carried_on_twice_is_carried_on_by_the_sum(plan: WirePlan, a: int, b: int) -> None:
    assert carried_on(carried_on(plan, a), b) == carried_on(plan, a + b)
    assert carried_on(plan, 0) == plan


@given(resting_plans, knots)
def test_carried_on_is_the_same_motion_and_then_rest(plan: WirePlan, by: int) -> None:
    on, states = carried_on(plan, by), plan.states()
    n = len(plan.accelerations)
    assert on.epoch == plan.epoch + by * plan.dt
    assert len(on.accelerations) == n
    assert rests(on)
    np.testing.assert_array_equal(on.states(), states[np.minimum(np.arange(by, by + n + 1), n)])


@given(resting_plans, knots)
def test_a_receiver_carries_on_the_same_bits(plan: WirePlan, by: int) -> None:
    received = unpack(pack(plan))
    assert received == plan
    assert pack(carried_on(received, by)) == pack(carried_on(plan, by))
    assert controls(carried_on(received, by)).tobytes() == controls(carried_on(plan, by)).tobytes()


@given(resting_plans, knots)
def test_control_points_are_the_same_bits_before_and_after_carrying_on(plan: WirePlan, by: int) -> None:
    """For the neighbours' are moved on as control points, and one's own as integers."""
    by = min(by, len(plan.accelerations))
    moved = controls(carried_on(plan, by))
    there = len(moved) - by
    assert moved[:there].tobytes() == controls(plan)[by:].tobytes()
    np.testing.assert_array_equal(moved[there:], np.broadcast_to(controls(plan)[-1, 2], (by, 3, 3)))


@given(seeds, st.integers(1, STEPS))
def test_committing_keeps_the_start_rounds_by_half_a_unit_and_rests(seed: int, steps: int) -> None:
    rng = np.random.default_rng(seed)
    start = quantise(EPOCH, DT, rng.uniform(-9, 9, 3), rng.uniform(-5, 5, 3), np.zeros((steps, 3)), 1)
    wanted = rng.uniform(-2, 2, (steps, 3))
    wanted[-1] -= start.velocity_m_s / (1e-6 * DT) + wanted.sum(axis=0)
    plan = committed(start, wanted)
    assert (plan.epoch, plan.dt, plan.origin) == (start.epoch, start.dt, start.origin)
    assert (plan.position, plan.velocity) == (start.position, start.velocity)
    assert rests(plan)
    off = 1e3 * np.abs(plan.accelerations_m_s2 - wanted)
    assert off[:-1].max(initial=0.0) <= 0.5 + 1e-9
    # What comes to rest without rounding is brought to rest by what all the others were rounded by.
    assert off[-1].max() <= 0.5 * (steps - 1) + 1e-6


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_never_committed(bad: float) -> None:
    accelerations = np.zeros((STEPS, 3))
    accelerations[3, 1] = bad
    with pytest.raises(CertificateError):
        committed(resting(EPOCH, DT, STEPS, np.zeros(3), 1), accelerations)


@given(seeds)
def test_every_segment_lies_in_the_hull_of_its_control_points(seed: int) -> None:
    """At s of a segment with the weights (1 − s)², 2 s (1 − s), s², which are ≥ 0 and add up to one."""
    plan = random_plan(np.random.default_rng(seed), np.array([3.0, -4.0, 5.0]))
    horizon, count = horizon_of(plan), 21
    times = plan.epoch + np.arange(STEPS)[:, None] * DT + np.arange(count) * (DT // (count - 1))
    flown = np.array([[horizon.at(int(time)).position for time in row] for row in times])
    np.testing.assert_allclose(flown, curves(controls(plan), count), rtol=0.0, atol=1e-9)
    after = horizon.at(horizon.end + 3_000_000)
    np.testing.assert_array_equal(after.position, flown[-1, -1])
    assert not after.velocity.any()


@given(coordinate, coordinate, st.floats(0.0, 120.0), st.integers(0, 2**30))
def test_who_stands_stands_within_half_a_unit_for_ever(x: float, y: float, z: float, epoch: int) -> None:
    plan = resting(epoch * DT, DT, STEPS, (x, y, z), 1)
    points = controls(plan)
    assert rests(plan)
    assert np.abs(points - (x, y, z)).max() <= 0.25e-3 * (1e-6 * DT) ** 2 + 1e-12
    np.testing.assert_array_equal(points, np.broadcast_to(points[0, 0], points.shape))
