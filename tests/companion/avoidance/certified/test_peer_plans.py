"""Plans of one sender: one for each epoch, none that is needed is discarded, later points are exact."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.committed import carried_on, controls, resting
from companion.avoidance.certified.peer_plans import PlanFile, read, stored
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.plan import WirePlan, pack
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS, random_plan

LENGTH = 200_000
seeds = st.integers(0, 2**32 - 1)


def plan(number: int, x: float = 0.0) -> WirePlan:
    """At rest at (x, 0, 5) m from epoch ``number`` on."""
    return resting(EPOCH + number * LENGTH, DT, STEPS, (x, 0.0, 5.0), 7)


@given(seeds, st.integers(0, 2 * STEPS), st.integers(1, 2 * STEPS))
def test_later_control_points_are_those_of_the_plan_carried_on(seed: int, knots: int, rows: int) -> None:
    """Bit by bit: both vehicles of an agreement compute the same planes from them."""
    of = random_plan(np.random.default_rng(seed), np.array([1.0, 2.0, 5.0]))
    expected = [controls(carried_on(of, knots)), controls(carried_on(of, knots + STEPS))]
    found = stored(of).later(of.epoch + knots * DT, rows)
    np.testing.assert_array_equal(found, np.concatenate(expected)[:rows])


def test_what_is_stored_is_not_altered() -> None:
    one = stored(plan(0))
    with pytest.raises(ValueError, match="read-only"):
        one.controls[0, 0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        one.later(EPOCH, STEPS)[0, 0, 0] = 1.0
    np.testing.assert_array_equal(one.later(EPOCH, STEPS), controls(plan(0)))


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 1)), min_size=1, max_size=20))
def test_of_each_epoch_the_first_plan_stays(some: list[tuple[int, int]]) -> None:
    file, first = PlanFile(), dict[int, WirePlan]()
    for number, x in some:
        given_plan = plan(number, x)
        kept = first.setdefault(given_plan.epoch, given_plan)
        assert file.add(stored(given_plan)) == (kept == given_plan)
    for epoch, kept in first.items():
        found = file.get(epoch)
        assert found is not None
        assert found.plan == kept
    assert file.newest is not None
    assert file.newest.plan == first[max(first)]
    for number in range(-1, 7):
        epoch = EPOCH + number * LENGTH
        before = file.before(epoch)
        known = [one for one in first if one <= epoch]
        assert (before.plan if before else None) == (first[max(known)] if known else None)


@given(st.sets(st.integers(0, 199), max_size=5))
def test_plans_of_agreements_are_never_discarded_and_others_are(needed: set[int]) -> None:
    file = PlanFile()
    for number in range(200):
        wanted = [EPOCH + one * LENGTH for one in needed]
        assert file.add(stored(plan(number)), wanted)
        for one in needed:
            assert (file.get(EPOCH + one * LENGTH) is not None) == (one <= number)
    filed = [number for number in range(200) if file.get(EPOCH + number * LENGTH) is not None]
    assert set(filed) >= needed
    assert len(filed) <= 48 + len(needed)
    assert filed[-1] == 199


def test_a_cleared_file_is_empty() -> None:
    file = PlanFile()
    file.add(stored(plan(0)))
    file.clear()
    assert file.newest is None
    assert file.get(EPOCH) is None
    assert file.before(EPOCH) is None
    assert file.add(stored(plan(0, x=1.0)))


@given(st.integers(0, 8 * 128 - 1))
def test_a_plan_altered_in_one_bit_is_refused_or_another(bit: int) -> None:
    true = pack(plan(0))
    altered = bytearray(true)
    altered[bit // 8] ^= 1 << bit % 8
    try:
        other, _ = read(bytes(altered))
    except PlanWireError:
        return
    assert other.plan != plan(0)


def test_a_plan_is_read_with_whether_it_ends_at_rest() -> None:
    assert read(pack(plan(0)))[1]
    moving = plan(0)._replace(velocity=(1, 0, 0))
    found, rests = read(pack(moving))
    assert found.plan == moving
    assert not rests
