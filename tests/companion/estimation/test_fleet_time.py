"""Laws of fleet time: the truth is inside as long as no more sources are wrong than are tolerated."""

from __future__ import annotations

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.estimation.fleet_time import Offset, agreed

NOW = 1_767_225_600_000_000
times = st.integers(-(10**12), 10**12)
widths = st.integers(0, 100_000)


@st.composite
def truthful(draw: st.DrawFn, truth: int) -> Offset:
    """A source whose interval holds ``truth``."""
    return Offset(truth - draw(widths), truth + draw(widths), NOW)


@st.composite
def liars(draw: st.DrawFn) -> Offset:
    """A source that may say anything."""
    middle, width = draw(times), draw(widths)
    return Offset(middle - width, middle + width, NOW)


@given(st.data(), times, st.integers(1, 8), st.integers(0, 4))
def test_the_truth_is_inside_if_a_tolerated_minority_is_wrong(
    data: st.DataObject, truth: int, right: int, tolerated: int
) -> None:
    wrong = data.draw(st.integers(0, min(tolerated, right - 1)))
    sources = [data.draw(truthful(truth)) for _ in range(right)] + [data.draw(liars()) for _ in range(wrong)]
    found = agreed(data.draw(st.permutations(sources)), tolerated, NOW)
    assert found is not None
    assert found.least <= truth <= found.most
    assert found.at == NOW


@given(st.lists(liars(), min_size=1, max_size=6), st.integers(0, 3))
def test_both_ends_are_in_enough_sources_and_no_point_further_out_is(
    sources: list[Offset], tolerated: int
) -> None:
    enough = len(sources) - min(tolerated, (len(sources) - 1) // 2)
    found = agreed(sources, tolerated, NOW)

    def holding(point: int) -> int:
        return sum(one.least <= point <= one.most for one in sources)

    points = sorted({end for one in sources for end in (one.least, one.most)})
    if found is None:
        assert max(map(holding, points)) < enough
        return
    assert holding(found.least) >= enough
    assert holding(found.most) >= enough
    outside = [point for point in points if not found.least <= point <= found.most]
    assert all(holding(point) < enough for point in [*outside, found.least - 1, found.most + 1])


@given(st.lists(liars(), min_size=1, max_size=6), st.integers(0, 3), times)
def test_a_shift_of_the_own_clock_shifts_the_answer(sources: list[Offset], wrong: int, by: int) -> None:
    found = agreed(sources, wrong, NOW)
    moved = agreed([one.shifted(by, by) for one in sources], wrong, NOW)
    assert moved == (None if found is None else found.shifted(by, by))


def test_without_sources_there_is_no_time() -> None:
    assert agreed([], 1, NOW) is None


@pytest.mark.parametrize("count", [1, 2])
def test_of_one_or_two_none_may_be_wrong(count: int) -> None:
    sources = [Offset(100 * k, 100 * k + 10, NOW) for k in range(count)]
    assert agreed(sources, 5, NOW) == (sources[0] if count == 1 else None)


def test_a_third_decides() -> None:
    sources = [Offset(-10, 10, NOW), Offset(5_000_000, 5_000_010, NOW), Offset(-5, 20, NOW)]
    assert agreed(sources, 1, NOW) == Offset(-5, 10, NOW)
    assert agreed(sources, 0, NOW) is None


@given(liars(), st.integers(-100, 100), st.lists(st.integers(1, 10**7), min_size=1, max_size=20))
def test_an_interval_grows_with_age_by_at_least_the_drift(
    offset: Offset, drift: int, steps: list[int]
) -> None:
    """Also in many small steps, and for a clock that drifts all the while."""
    aged, now, middle = offset, NOW, offset.middle
    for step in steps:
        now += step
        aged = aged.aged(now, 100)
    passed = now - NOW
    assert aged.least <= middle + passed * drift // 1_000_000
    assert middle - (-passed * drift // 1_000_000) <= aged.most
    assert aged.bound <= offset.bound + passed * 100 // 1_000_000 + len(steps) + 1


@given(st.data(), times)
def test_two_that_hold_the_truth_narrow_to_one_that_does(data: st.DataObject, truth: int) -> None:
    old, new = data.draw(truthful(truth)), data.draw(truthful(truth))._replace(at=NOW + 3_000_000)
    found = old.narrowed(new, 100)
    assert found is not None
    assert found.least <= truth <= found.most
    assert (found.at, found.bound <= new.bound + 1) == (new.at, True)


@given(liars(), liars())
def test_two_without_a_common_point_narrow_to_nothing(one: Offset, other: Offset) -> None:
    assume(one.most < other.least or other.most < one.least)
    assert one.narrowed(other, 100) is None
