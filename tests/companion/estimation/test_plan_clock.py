"""When a shared plan begins: as it says, unless the other plans of its sender tell of a wrong clock; then as
they tell."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.estimation.plan_clock import PlanClock
from tests.companion.rig import LAWS, QUICK

NOW = 1_767_225_600_000_000
DELAY, STALE, DT, PERIOD = 20_000, 500_000, 100_000, 100_000


def receives(clock: PlanClock, off: int, delays: list[int]) -> list[int | None]:
    """How far each of a stream of plans is dated from when it was really made; ``off``: the sender's clock
    minus ours."""
    errors: list[int | None] = []
    for k, delay in enumerate(delays):
        made = NOW + k * PERIOD
        begins = clock.begins(made + delay, made + off, DT)
        errors.append(None if begins is None else begins - made)
    return errors


NEAR = 50_000
"""How far an epoch may be from what the stream of plans tells."""


@LAWS
@given(st.integers(-25_000, 25_000), st.lists(st.integers(DELAY, DELAY + 25_000), min_size=1, max_size=30))
def test_the_epoch_of_a_good_clock_is_believed_to_the_microsecond(off: int, delays: list[int]) -> None:
    clock = PlanClock(DELAY, STALE)
    assert receives(clock, off, delays) == [off] * len(delays)


@LAWS
@given(st.lists(st.integers(DELAY, STALE), min_size=1, max_size=60), st.integers(0, 9))
def test_a_link_that_becomes_slow_or_was_slow_at_first_changes_nothing(delays: list[int], quick: int) -> None:
    """One quick plan of the first ten tells that the clock is right."""
    delays.insert(min(quick, len(delays)), DELAY)
    assert receives(PlanClock(DELAY, STALE), 0, delays) == [0] * len(delays)


@LAWS
@given(
    st.one_of(st.integers(-STALE + 100_000, -NEAR - 1), st.integers(NEAR + 1, DT)),
    st.integers(10, 40),
    st.integers(0, 100_000),
)
def test_a_clock_that_is_wrong_by_less_than_a_plan_lives_is_seen_through_within_ten(
    off: int, count: int, jitter: int
) -> None:
    delays = [DELAY] + [DELAY + 7919 * k % (jitter + 1) for k in range(1, count)]
    errors = receives(PlanClock(DELAY, STALE), off, delays)
    assert errors[:9] == [off] * 9
    assert all(error is not None and abs(error) <= 1000 for error in errors[9:])


@LAWS
@given(st.integers(-10_000_000, 10_000_000), st.integers(DELAY, 400_000), st.integers(1, 50))
def test_a_plan_that_is_held_began_when_it_began(off: int, delay: int, times: int) -> None:
    """Told of again and again, it ages; a new one is dated as if the old had not been repeated."""
    clock, other = PlanClock(DELAY, STALE), PlanClock(DELAY, STALE)
    receives(clock, off, [delay] * 12)
    receives(other, off, [delay] * 12)
    made = NOW + 12 * PERIOD
    first = clock.begins(made + delay, made + off, DT)
    other.begins(made + delay, made + off, DT)
    assert first is not None
    again = [clock.begins(made + delay + k * PERIOD, made + off, DT) for k in range(1, times + 1)]
    assert again == [first] * times
    after = made + (times + 1) * PERIOD
    assert clock.begins(after + delay, after + off, DT) == other.begins(after + delay, after + off, DT)


@QUICK
@given(
    st.one_of(st.integers(-(10**9), -STALE - 1), st.integers(DT + 300_000, 10**9)),
    st.lists(st.integers(DELAY, 60_000), min_size=10, max_size=40),
)
def test_a_wrong_clock_is_seen_through_after_some_evidence(off: int, delays: list[int]) -> None:
    errors = receives(PlanClock(DELAY, STALE), off, delays)
    assert errors[:2] == [None, None]
    late = max(delays) - DELAY
    assert all(error is not None and abs(error) <= late for error in errors[2:])


@pytest.mark.parametrize("off", [-3_600_000_000, 3_600_000_000])
def test_one_plan_of_another_time_is_refused_and_changes_nothing(off: int) -> None:
    clock = PlanClock(DELAY, STALE)
    assert receives(clock, 0, [DELAY] * 5) == [0] * 5
    assert clock.begins(NOW + 600_000, NOW + 600_000 + off, DT) is None
    assert clock.begins(NOW + 700_000, NOW + 680_000, DT) == NOW + 680_000


def test_plans_all_over_the_place_are_never_believed() -> None:
    clock = PlanClock(DELAY, STALE)
    for k in range(30):
        off = (-1) ** k * (10_000_000 + 7_000_000 * k)
        assert clock.begins(NOW + k * PERIOD, NOW + k * PERIOD + off, DT) is None
