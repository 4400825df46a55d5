"""What a companion compensates is continued: what was added to its set-points is κ v + w."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.sent_compensation import SentCompensation
from companion.values.horizon import Array

seeds = st.integers(0, 2**32 - 1)


def observed(seed: int, drag: float, wind: Array, *, seconds: float = 10.0) -> tuple[SentCompensation, Array]:
    """Set-points at 50 Hz of a vehicle that swings about; the last velocity."""
    rng = np.random.default_rng(seed)
    rate, phase = rng.uniform(0.5, 1.5, 2), rng.uniform(0.0, 6.3, 2)
    sent, velocity = SentCompensation(), np.zeros(2)
    for k in range(round(50 * seconds)):
        velocity = 3.0 * np.sin(0.02 * k * rate + phase)
        sent.observe(20_000 * k, velocity, drag * velocity + wind)
    return sent, velocity


@given(seeds, st.floats(0.0, 1.5), st.floats(-2.0, 2.0))
def test_it_is_continued_along_the_plan(seed: int, drag: float, wind: float) -> None:
    blows = np.array([wind, -0.5 * wind])
    sent, last = observed(seed, drag, blows)
    np.testing.assert_allclose(sent.at(last), [*(drag * last + blows), 0.0], atol=1e-9)
    for velocity in (np.zeros(2), np.array([-2.0, 1.0])):
        expected = drag * velocity + blows
        np.testing.assert_allclose(sent.at(velocity)[:2], expected, atol=0.02 * (1.0 + drag * 5.0))


def test_a_hover_shows_no_drag() -> None:
    sent = SentCompensation()
    assert not sent.at(np.ones(2)).any()
    rng = np.random.default_rng(1)
    for k in range(500):
        sent.observe(20_000 * k, 0.01 * rng.normal(size=2), np.array([0.5, 0.2]) + 0.02 * rng.normal(size=2))
    off = sent.at(np.array([3.0, 0.0])) - sent.at(np.zeros(2))
    assert np.abs(off).max() < 0.3


def test_after_a_pause_earlier_set_points_do_not_count() -> None:
    sent, _ = observed(1, 1.2, np.zeros(2))
    sent.observe(60_000_000, np.zeros(2), np.array([0.3, 0.0]))
    np.testing.assert_allclose(sent.at(np.array([2.0, 2.0])), [0.3, 0.0, 0.0])
