"""The square-root law of the position controllers, and vectors that are taken apart."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.autopilot.position_control.square_root import (
    cut,
    directed,
    inverse_square_root_law,
    joined,
    split,
    square_root_law,
)

GAINS = st.floats(0.1, 10.0)
LIMITS = st.floats(0.1, 20.0)
ERRORS = st.floats(-200.0, 200.0)
PAIRS = st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))


@given(ERRORS, GAINS, LIMITS)
def test_it_is_odd_and_closes_the_error(error: float, gain: float, limit: float) -> None:
    rate = square_root_law(error, gain, limit)
    assert rate == -square_root_law(-error, gain, limit)
    assert rate * error >= 0.0
    assert abs(rate) <= gain * abs(error) * (1.0 + 1e-12)


@given(ERRORS, st.floats(0.0, 5.0), GAINS, LIMITS)
def test_it_is_continuous_and_never_falls(error: float, further: float, gain: float, limit: float) -> None:
    """It is nowhere steeper than at zero, where its slope is the gain."""
    rise = square_root_law(error + further, gain, limit) - square_root_law(error, gain, limit)
    assert -1e-9 <= rise <= gain * further * (1.0 + 1e-9) + 1e-9


@given(st.floats(1e-3, 200.0), GAINS, LIMITS)
def test_braking_by_it_asks_for_no_more_than_the_limit(error: float, gain: float, limit: float) -> None:
    """ė = −f(e), so f changes at f'·f."""
    small = 1e-6 * error
    slope = (square_root_law(error + small, gain, limit) - square_root_law(error - small, gain, limit)) / (
        2.0 * small
    )
    assert slope * square_root_law(error, gain, limit) <= limit * (1.0 + 1e-5)


@given(st.floats(0.0, 50.0), GAINS, LIMITS)
def test_its_inverse_is_its_inverse(rate: float, gain: float, limit: float) -> None:
    error = inverse_square_root_law(rate, gain, limit)
    assert square_root_law(error, gain, limit) == pytest.approx(rate, rel=1e-9, abs=1e-12)
    assert inverse_square_root_law(square_root_law(error, gain, limit), gain, limit) == pytest.approx(
        error, rel=1e-9, abs=1e-12
    )


@given(ERRORS, GAINS, LIMITS, st.floats(1e-3, 1.0))
def test_it_does_not_overshoot_within_a_step(error: float, gain: float, limit: float, dt: float) -> None:
    assert abs(square_root_law(error, gain, limit, dt)) * dt <= abs(error) * (1.0 + 1e-12)


@given(PAIRS, GAINS, LIMITS)
def test_along_a_vector_it_is_that_of_its_length(
    error: tuple[float, float], gain: float, limit: float
) -> None:
    rate = directed(error, gain, limit)
    assert rate[0] * error[1] == pytest.approx(rate[1] * error[0], rel=1e-9, abs=1e-9)
    assert math.hypot(*rate) == pytest.approx(
        square_root_law(math.hypot(*error), gain, limit), rel=1e-9, abs=1e-9
    )


@given(PAIRS, PAIRS)
def test_what_is_split_is_joined_again(vector: tuple[float, float], along: tuple[float, float]) -> None:
    part, across, direction = split(vector, along)
    assert across[0] * direction[0] + across[1] * direction[1] == pytest.approx(0.0, abs=1e-9)
    assert joined(part, across, direction) == pytest.approx(vector, rel=1e-9, abs=1e-9)


@given(PAIRS, st.floats(0.0, 100.0))
def test_a_vector_is_cut_in_its_direction(vector: tuple[float, float], most: float) -> None:
    found = cut(vector, most)
    size = math.hypot(*vector)
    assert math.hypot(*found) == pytest.approx(min(size, most), rel=1e-9, abs=1e-12)
    assert found[0] * vector[1] == pytest.approx(found[1] * vector[0], rel=1e-9, abs=1e-9)
