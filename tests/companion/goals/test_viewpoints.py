"""Laws of the bearings from which a target is located best: fused covariance, descent, and rest."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.goals.viewpoints import Crossing, anisotropy, aside, descent, weight

COUNTS = st.integers(2, 8)
SEEDS = st.integers(0, 10_000)
APART = 0.6


def drawn(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng([seed, count])
    return random.uniform(-np.pi, np.pi, count), random.uniform(0.5, 4.0, count)


def share(bearings, weights, prior: complex = 0j) -> float:
    return abs(anisotropy(bearings, weights, prior)) / weights.sum()


def rested(bearings, weights, prior: complex = 0j, around: float = 0.3, steps: int = 400):
    """Where small steps down from ``bearings`` end, with saddles left as a vehicle leaves them."""
    for _ in range(steps):
        turns = descent(bearings, weights, prior, around)
        if share(bearings, weights, prior) > 0.1:
            turns = turns + aside(bearings, weights, prior, 0.1)
        bearings = bearings + 0.1 * turns
    return bearings


@given(COUNTS, SEEDS)
def test_the_fused_covariance_has_the_eigenvalues_of_a_and_s(count, seed):
    random = np.random.default_rng(seed)
    bearings, distances = random.uniform(-np.pi, np.pi, count), random.uniform(2.0, 20.0, count)
    along, across = 0.75, np.radians(1.0) * distances
    information = np.zeros((2, 2))
    for bearing, sideways in zip(bearings, across, strict=True):
        ray, side = (
            np.array([np.cos(bearing), np.sin(bearing)]),
            np.array([-np.sin(bearing), np.cos(bearing)]),
        )
        information += np.outer(ray, ray) / along**2 + np.outer(side, side) / sideways**2
    a = 0.5 * (count / along**2 + (1.0 / across**2).sum())
    s = abs(anisotropy(bearings, weight(along, 1.0, distances)))
    np.testing.assert_allclose(np.linalg.eigvalsh(np.linalg.inv(information)), [1 / (a + s), 1 / (a - s)])


@given(COUNTS, SEEDS)
def test_it_turns_down_the_slope_of_the_square_of_s(count, seed):
    bearings, weights = drawn(count, seed)
    prior = complex(*np.random.default_rng(seed).normal(size=2))
    turns = descent(bearings, weights, prior)
    for k in range(count):
        step = np.zeros(count)
        step[k] = 1e-6
        up, down = (0.5 * abs(anisotropy(bearings + by, weights, prior)) ** 2 for by in (step, -step))
        slope = (up - down) / 2e-6
        assert turns[k] == pytest.approx(-slope / (weights[k] * weights.sum()), abs=1e-6)


@given(st.integers(3, 8), SEEDS)
def test_going_all_around_and_parting_cost_nothing_to_first_order(count, seed):
    bearings, weights = drawn(count, seed)
    parts = 2j * weights * np.exp(2j * bearings) / weights.sum()
    # Where all bearings are nearly on one line, nothing is free of costs.
    slopes = np.linalg.svd(np.array([parts.real, parts.imag]), compute_uv=False)
    assume(slopes.min() > 0.3)
    further = descent(bearings, weights, around=0.5, apart=APART) - descent(bearings, weights)
    assert abs(parts @ further) <= 0.02


@given(COUNTS, SEEDS, st.floats(-3.0, 3.0))
def test_a_turned_fleet_turns_as_much(count, seed, by):
    bearings, weights = drawn(count, seed)
    prior = complex(*np.random.default_rng(seed).normal(size=2))
    np.testing.assert_allclose(
        descent(bearings + by, weights, prior * np.exp(2j * by), 0.3, APART),
        descent(bearings, weights, prior, 0.3, APART),
        atol=1e-6,
    )


@given(COUNTS, SEEDS)
def test_the_order_of_the_cameras_does_not_matter(count, seed):
    bearings, weights = drawn(count, seed)
    order = np.random.default_rng(seed).permutation(count)
    np.testing.assert_allclose(
        descent(bearings[order], weights[order], 0j, 0.3, APART),
        descent(bearings, weights, 0j, 0.3, APART)[order],
        atol=1e-9,
    )


@pytest.mark.parametrize(
    ("weights", "least"),
    [([1, 1], 0.0), ([1, 1, 1], 0.0), ([1] * 5, 0.0), ([1] * 8, 0.0), ([3, 1], 0.5), ([3, 1, 1], 0.2),
     ([3, 1, 1, 1, 1], 0.0)],
)  # fmt: skip
def test_from_random_bearings_it_rests_where_no_other_is_better(weights, least):
    w = np.array(weights, dtype=float)
    random = np.random.default_rng(7)
    ends = [share(rested(random.uniform(-np.pi, np.pi, len(w)), w), w) for _ in range(10)]
    assert least - 1e-6 <= min(ends)
    assert max(ends) <= least + 0.03


def test_two_rest_at_right_angles():
    ends = rested(np.array([0.3, 0.5]), np.ones(2))
    assert abs(np.sin(ends[0] - ends[1])) == pytest.approx(1.0, abs=1e-6)


def test_what_is_known_already_is_looked_at_from_the_side():
    """A prior that knows north well and east badly wants a ray from north or south: it measures east best."""
    known = 2.0
    # −½(λ₁ − λ₂)e^{2iφ₁} with φ₁ = 90°.
    end = rested(np.array([0.4]), np.ones(1), prior=complex(-0.5 * known * np.exp(1j * np.pi)))
    assert abs(np.cos(end[0])) < 1e-3


@pytest.mark.parametrize("bearings", [[0.0, 0.0], [0.0, np.pi], [0.0, 0.0, np.pi], [0.0] * 5])
def test_cameras_on_one_line_leave_it(bearings):
    start, weights = np.array(bearings), np.ones(len(bearings))
    np.testing.assert_allclose(descent(start, weights), 0.0, atol=1e-12)
    assert share(rested(start, weights), weights) < 0.03


def test_without_cameras_and_alone_nothing_turns():
    np.testing.assert_array_equal(descent(np.array([1.0, 2.0]), np.zeros(2)), 0.0)
    np.testing.assert_allclose(descent(np.array([1.0]), np.ones(1)), 0.0, atol=1e-12)


def test_of_two_in_each_others_way_the_second_goes_to_the_opposite_side():
    first, second = Crossing(), Crossing()
    bearings, crossed = np.array([0.0, 0.1]), 0.0
    for tick in range(200):
        now = 50_000 * tick
        assert first.sense(now, 0, bearings, APART, 0.0) == 0.0
        # The descent opposes the way up to the side and leads on from there.
        led = -np.cos(bearings[1])
        sense = second.sense(now, 1, bearings, APART, led)
        bearings[1] += 0.05 * sense
        crossed += 0.05 * abs(sense)
    assert 0.5 * np.pi - 0.1 < crossed < 0.6 * np.pi
    assert bearings[1] == pytest.approx(0.1 + crossed)


def test_a_camera_that_is_never_led_on_gives_up():
    crossing, bearings, crossed = Crossing(), np.array([0.0, 0.1]), 0.0
    for tick in range(140):
        crossed += 0.05 * crossing.sense(50_000 * tick, 1, bearings, APART, -1.0)
        bearings[1] = 0.1 + crossed
    assert np.pi < crossed < 1.3 * np.pi


def test_nobody_crosses_to_a_place_that_is_taken():
    crossing = Crossing()
    bearings = np.array([0.0, 0.1, np.pi])
    assert not any(crossing.sense(50_000 * tick, 1, bearings, APART, 0.0) for tick in range(200))


@pytest.mark.parametrize(
    ("scales", "low", "high"),
    [
        ([1.0, 1.0, 1.0, np.inf, np.inf], 0.92, 0.93),
        ([1.0, 1.0, 1.0, 3.0, 3.0], 0.94, 0.96),
    ],
    ids=["two see nothing", "two are three times worse"],
)
def test_with_two_of_five_cameras_worse_the_best_bearings_gain_less_than_a_tenth(scales, low, high):
    """RMSE in the plane at the least |s|, relative to equal angles, over all places of the two."""
    along, across = 0.6 * np.array(scales), np.radians(1.0) * np.hypot(6.0, 5.0) * np.array(scales)
    a, weights = 0.5 * (along**-2.0 + across**-2.0), 0.5 * (across**-2.0 - along**-2.0)
    least = max(0.0, 2.0 * weights.max() - weights.sum())
    even = 2.0 * np.pi * np.arange(5) / 5
    squares = np.array([abs(anisotropy(even, weights[list(order)])) ** 2 for order in permutations(range(5))])
    traces = 2.0 * a.sum() / (a.sum() ** 2 - squares)
    best = 2.0 * a.sum() / (a.sum() ** 2 - least**2)
    assert low < np.sqrt(best / traces.mean()) < high
    # The optimum is reached, so this is a bound that holds and not one that is too low.
    starts = drawn(5, 3)[0]
    assert share(rested(starts, weights), weights) == pytest.approx(least / weights.sum(), abs=0.03)
