"""Intervals against published values, and against how often they hold."""

from __future__ import annotations

from math import inf, isfinite

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.sweep.statistics import largest, least, plain, quantile, ranks, rate

FLOATS = st.floats(-1e6, 1e6)


# Rates


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        # Newcombe, Statistics in Medicine 17 (1998), Table I, method 3: the score method.
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_s_interval_is_the_published_one(successes: int, trials: int, low: float, high: float) -> None:
    found = rate(successes, trials)
    assert found is not None
    assert found.value == successes / trials
    assert found.low == pytest.approx(low, abs=5e-5)
    assert found.high == pytest.approx(high, abs=5e-5)


@given(st.integers(1, 2000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_a_rate_lies_in_its_interval_and_mirrors(case: tuple[int, int]) -> None:
    successes, trials = case
    found, mirrored = rate(successes, trials), rate(trials - successes, trials)
    assert found is not None
    assert mirrored is not None
    assert 0.0 <= found.low <= found.value <= found.high <= 1.0
    assert found.low == pytest.approx(1.0 - mirrored.high, abs=1e-12)


def test_no_trials_have_no_rate() -> None:
    assert rate(0, 0) is None
    with pytest.raises(ValueError, match="3 successes of 2"):
        rate(3, 2)


# Quantiles


@pytest.mark.parametrize(
    ("count", "level", "expected"),
    [
        # The two-sided sign test's critical ranks: none below 6, then as in any table of it.
        (5, 0.5, (0, 6)),
        (6, 0.5, (1, 6)),
        (10, 0.5, (2, 9)),
        (20, 0.5, (6, 15)),
        (50, 0.5, (18, 33)),
        (100, 0.5, (40, 61)),
    ],
)
def test_the_ranks_of_a_median_are_those_of_the_tables(
    count: int, level: float, expected: tuple[int, int]
) -> None:
    assert ranks(count, level) == expected


@pytest.mark.parametrize("level", [0.05, 0.5, 0.95])
@pytest.mark.parametrize("count", [6, 59, 60, 333, 1000])
def test_the_ranks_are_the_tightest_that_hold(count: int, level: float) -> None:
    binomial = pytest.importorskip("scipy.stats").binom(count, level)
    lower, upper = ranks(count, level)
    assert binomial.cdf(lower - 1) <= 0.025 < binomial.cdf(lower)
    if upper <= count:
        assert binomial.sf(upper - 1) <= 0.025
    assert binomial.sf(upper - 2) > 0.025


def test_a_quantile_is_in_its_interval_as_often_as_it_says() -> None:
    random = np.random.default_rng(20)
    truth = 2.0 * -np.log(0.05)
    held = [
        found.low <= truth <= found.high
        for _ in range(2000)
        if (found := quantile(random.exponential(2.0, size=80).tolist(), 0.95)) is not None
    ]
    # Conservative: at least 95 %, less what 2000 draws scatter (3 σ = 1.5 %).
    assert np.mean(held) >= 0.935
    assert len(held) == 2000


@given(st.lists(FLOATS, min_size=1, max_size=60), st.sampled_from([0.05, 0.5, 0.95]))
def test_a_quantile_is_a_value_that_enough_do_not_exceed(values: list[float], level: float) -> None:
    found = quantile(values, level)
    assert found is not None
    assert found.value in values
    share = sum(value <= found.value for value in values) / len(values)
    below = sum(value < found.value for value in values) / len(values)
    assert share >= level - 1e-9
    assert below < level
    assert found.low <= found.value <= found.high


@given(st.lists(FLOATS, min_size=1, max_size=40), st.randoms(), st.floats(0.1, 10.0))
def test_quantiles_know_neither_order_nor_unit(values: list[float], random: object, unit: float) -> None:
    shuffled = values.copy()
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    assert quantile(shuffled, 0.95) == quantile(values, 0.95)
    scaled = quantile([unit * value for value in values], 0.5)
    found = quantile(values, 0.5)
    assert scaled is not None
    assert found is not None
    assert scaled.value == unit * found.value


def test_what_never_came_is_longer_than_everything() -> None:
    some = [1.0] * 98 + [inf] * 2
    many = [1.0] * 90 + [inf] * 10
    half = [1.0] * 49 + [inf] * 51
    assert plain(some, 0.95) == 1.0
    assert plain(many, 0.95) is None
    median = quantile(half, 0.5)
    assert median is not None
    assert (median.value, median.low, median.high) == (inf, 1.0, inf)
    assert largest(some) == 1.0


def test_a_small_sample_bounds_nothing() -> None:
    found = quantile([3.0, 1.0, 2.0], 0.5)
    assert found is not None
    assert found == (2.0, -inf, inf)


def test_nothing_has_no_quantile() -> None:
    assert quantile([], 0.5) is None
    assert plain([], 0.5) is None
    assert least([]) is None
    assert largest([inf]) is None
    for level in (0.0, 1.0, -1.0):
        with pytest.raises(ValueError, match="level"):
            quantile([1.0], level)


def test_p95_of_a_thousand() -> None:
    found = quantile([float(i) for i in range(1, 1001)], 0.95)
    assert found is not None
    # np + z√(np(1−p)) = 950 ± 13.5
    assert (found.value, found.low, found.high) == (950.0, 936.0, 964.0)
    assert isfinite(found.high)
