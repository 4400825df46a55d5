"""The time left is that of the pace so far."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.terminal.time_left import TimeLeft, duration


@given(pace=st.floats(1e-3, 0.05), began=st.floats(-1e6, 1e6), share=st.floats(0.0, 0.5))
def test_at_a_steady_pace_it_is_exact(pace: float, began: float, share: float) -> None:
    now = began
    left = TimeLeft(lambda: now)
    assert left.seconds(share) is None
    now += 8.0
    done = share + 8.0 * pace
    assert left.seconds(done) == pytest.approx((1.0 - done) / pace, rel=1e-4)


def test_it_is_silent_at_first_and_begins_anew_with_new_work() -> None:
    now = 0.0
    left = TimeLeft(lambda: now)
    assert left.words(0.0) == ""
    now = 1.0
    assert left.words(0.5) == ""
    now = 4.0
    assert left.words(0.5) == "about 4 s left"
    assert left.words(0.1) == ""


@pytest.mark.parametrize(
    ("seconds", "said"), [(3.2, "3 s"), (99.0, "99 s"), (130.0, "2 min"), (7800.0, "2 h 10 min")]
)
def test_durations_are_said_as_people_say_them(seconds: float, said: str) -> None:
    assert duration(seconds) == said
