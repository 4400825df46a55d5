"""When a shared plan begins: as it says, unless its sender's clock cannot be right; then as the delays
tell."""

from __future__ import annotations

import pytest
from companion_rig import LAWS, QUICK
from hypothesis import given
from hypothesis import strategies as st

from companion.plan_clock import PlanClock

NOW = 1_767_225_600_000_000
DELAY, STALE, DT, PERIOD = 20_000, 500_000, 100_000, 100_000


def hears(clock: PlanClock, off: int, delays: list[int]) -> list[int | None]:
    """How far each of a stream of plans is dated from when it was really made; ``off``: the sender's clock
    minus ours."""
    errors: list[int | None] = []
    for k, delay in enumerate(delays):
        made = NOW + k * PERIOD
        begins = clock.begins(made + delay, made + off, DT)
        errors.append(None if begins is None else begins - made)
    return errors


@LAWS
@given(st.integers(-STALE // 2, DT // 2), st.lists(st.integers(DELAY, 200_000), min_size=1, max_size=20))
def test_a_plausible_epoch_is_believed_to_the_microsecond(off: int, delays: list[int]) -> None:
    clock = PlanClock(DELAY, STALE)
    assert hears(clock, off, delays) == [off] * len(delays)


@QUICK
@given(
    st.one_of(st.integers(-(10**9), -STALE - 1), st.integers(DT + 300_000, 10**9)),
    st.lists(st.integers(DELAY, 60_000), min_size=10, max_size=40),
)
def test_a_wrong_clock_is_seen_through_after_some_evidence(off: int, delays: list[int]) -> None:
    errors = hears(PlanClock(DELAY, STALE), off, delays)
    assert errors[:2] == [None, None]
    late = max(delays) - DELAY
    assert all(error is not None and abs(error) <= late for error in errors[2:])


@pytest.mark.parametrize("off", [-3_600_000_000, 3_600_000_000])
def test_one_plan_of_another_time_is_refused_and_changes_nothing(off: int) -> None:
    clock = PlanClock(DELAY, STALE)
    assert hears(clock, 0, [DELAY] * 5) == [0] * 5
    assert clock.begins(NOW + 600_000, NOW + 600_000 + off, DT) is None
    assert clock.begins(NOW + 700_000, NOW + 680_000, DT) == NOW + 680_000


def test_plans_all_over_the_place_are_never_believed() -> None:
    clock = PlanClock(DELAY, STALE)
    for k in range(30):
        off = (-1) ** k * (10_000_000 + 7_000_000 * k)
        assert clock.begins(NOW + k * PERIOD, NOW + k * PERIOD + off, DT) is None
