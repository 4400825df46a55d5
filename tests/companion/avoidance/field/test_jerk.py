"""Bounded jerk: plans keep it from the first step on, whatever field pushes; a field changes no faster."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.avoidance.field.dqmpc import Dqmpc
from companion.avoidance.field.jerk import Flown, rate_limited
from companion.config.planning import CostConfig, HorizonConfig, LimitsConfig

J_MAX = np.array([3.5, 3.5, 4.0])
LIMITS = LimitsConfig(u_max=(2.0, 2.0, 2.0), v_max=(3.5, 3.5, 1.5), a_total=4.0, j_max=tuple(J_MAX))
DQMPC = Dqmpc(HorizonConfig(), CostConfig(), LIMITS)
SMALL = st.floats(-1.0, 1.0, allow_nan=False)
TRIPLES = st.tuples(SMALL, SMALL, SMALL).map(np.array)


@settings(max_examples=60, deadline=None)
@given(x=TRIPLES, v=TRIPLES, a=TRIPLES, first=TRIPLES, last=TRIPLES, destination=TRIPLES)
def test_a_plan_keeps_the_bound_on_jerk(x, v, a, first, last, destination):
    position = np.array([0.0, 0.0, 6.5]) + 10.0 * x * [1.0, 1.0, 0.2]
    field = np.linspace(0.0, 1.0, DQMPC.n)[:, None] * 3.0 * (last - first) + 3.0 * first
    flown = Flown(2.0 * a, 0.02)
    problem = DQMPC.problem(position, v, field, 15.0 * destination, np.zeros(3), 1.0, flown)
    found = DQMPC.solve(problem, 1.0).acceleration
    assert np.isfinite(found).all()
    assert (np.abs(found[0] - flown.acceleration) <= 0.02 * J_MAX + 1e-6).all()
    assert (np.abs(np.diff(found, axis=0)) <= DQMPC.dt * J_MAX + 1e-6).all()


def test_without_a_bound_a_plan_may_change_at_once():
    free = Dqmpc(HorizonConfig(), CostConfig(), LIMITS.model_copy(update={"j_max": None}))
    problem = free.problem(
        np.array([0.0, 0.0, 6.0]), np.zeros(3), np.zeros((16, 3)), np.array([9.0, 0, 6]), np.zeros(3), 1.0
    )
    assert free.solve(problem, 1.0).acceleration[0, 0] > 1.0


@given(
    st.lists(TRIPLES, min_size=2, max_size=16).map(np.array),
    TRIPLES,
    st.floats(0.01, 1.0),
    st.floats(0.01, 1.0),
)
def test_a_field_changes_no_faster_than_it_may(force, last, first, step):
    found = rate_limited(force, last, first, step)
    changes = np.linalg.norm(np.diff(np.vstack([last, found]), axis=0), axis=1)
    assert changes[0] <= first + 1e-9
    assert (changes[1:] <= step + 1e-9).all()


@given(st.lists(TRIPLES, min_size=2, max_size=16).map(np.array))
def test_a_field_that_changes_slowly_passes(force):
    np.testing.assert_array_equal(rate_limited(force, force[0], 10.0, 10.0), force)


@pytest.mark.parametrize("push", [-4.0, 4.0])
def test_speed_limits_come_before_the_field(push):
    """A field that points along a velocity at its limit does not make the vehicle faster."""
    field = np.zeros((DQMPC.n, 3))
    field[:, 0] = push
    velocity = np.array([np.sign(push) * 3.4, 0.0, 0.0])
    flown = Flown(np.zeros(3), 0.02)
    problem = DQMPC.problem(np.array([0.0, 0.0, 6.0]), velocity, field, np.zeros(3), np.zeros(3), 1.0, flown)
    found = velocity + DQMPC.S_v @ DQMPC.solve(problem, 1.0).acceleration
    assert np.abs(found[:, 0]).max() <= 3.5 + 1e-5
