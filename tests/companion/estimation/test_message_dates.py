"""Dates of what is not filtered, such as images, on the clock of a sender that answers requests."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from companion.estimation.sender_clock import SenderClock
from companion.estimation.time_sync import RoundTrips
from mavlink_bridge.messages import Source, Timesync
from tests.companion.rig import LAWS, numbers

OWN, AUTOPILOT = Source(11, 195), Source(11, 1)
SET_US, LATEST_US = 5_000, 2_000_000
NOW = 1_767_225_600_000_000
BOOT = 10_000_000
PERIOD_US = 20_000
LATE_US = 100_000
"""Age of an image when it is read."""


class Autopilot:
    """Its clock drifts by ``drift``; its messages take ``down`` µs, requests ``up`` µs."""

    def __init__(self, down: int, up: int, drift: float = 0.0) -> None:
        self._down, self._drift = down, drift
        self.up = up
        self.step = 0

    def shows(self, time: int) -> int:
        """Its clock at ``time`` (µs) on the companion's."""
        return BOOT + self.step + round((1.0 + self._drift) * (time - NOW))

    def talks(self, clock: SenderClock, since: float, until: float, *, answers: bool = True) -> int:
        """Send its state for some time (s), and an answer each second; return when that ends (µs)."""
        sent = round(1e6 * since)
        for sent in range(round(1e6 * since), round(1e6 * until), PERIOD_US):
            clock.date(NOW + sent + self._down, self.shows(NOW + sent))
            if answers and sent % 1_000_000 == 0:
                asked = NOW + sent
                clock.answered(asked + self.up + self._down, asked, self.shows(asked + self.up))
        return NOW + sent + self.up + self._down

    def error(self, clock: SenderClock, now: int) -> int:
        """By how much (µs) later than it was taken an image is dated that is read at ``now``."""
        taken = now - LATE_US
        return clock.reads(now, self.shows(taken)) - taken


DELAYS = st.integers(0, 60_000)


@LAWS
@given(down=DELAYS, up=DELAYS, drift=numbers(-50e-6, 50e-6))
def test_a_date_is_wrong_by_no_more_than_half_of_the_difference_of_both_ways(down, up, drift):
    autopilot, clock = Autopilot(down, up, drift), SenderClock(SET_US, LATEST_US)
    now = autopilot.talks(clock, 0.0, 12.0)
    # A better answer of some seconds before may count, and the clock has drifted since.
    allowed = 0.5 * abs(down - up) + 50e-6 * 12e6 + 2
    assert abs(autopilot.error(clock, now)) <= allowed


@LAWS
@given(down=DELAYS, ups=st.lists(st.integers(0, 400_000), min_size=2, max_size=8))
def test_the_fastest_of_the_last_requests_counts(down, ups):
    """Half of its way there and back bounds the error, and what a clock may lose since."""
    autopilot, clock = Autopilot(down, ups[0]), SenderClock(SET_US, LATEST_US)
    for second, up in enumerate(ups):
        autopilot.up = up
        now = autopilot.talks(clock, float(second), second + 1.0)
    ages = range(len(ups) * 1_000_000, 0, -1_000_000)
    assert abs(autopilot.error(clock, now)) <= min(
        0.5 * (down + up) + 0.01 * age for up, age in zip(ups, ages, strict=True)
    )


@LAWS
@given(down=DELAYS)
def test_without_answers_the_delay_is_the_one_that_is_set(down):
    autopilot, clock = Autopilot(down, 0), SenderClock(SET_US, LATEST_US)
    now = autopilot.talks(clock, 0.0, 3.0, answers=False)
    assert autopilot.error(clock, now) == down - SET_US


@LAWS
@given(down=DELAYS, up=DELAYS)
def test_answers_that_end_count_for_ten_seconds(down, up):
    autopilot, clock = Autopilot(down, up), SenderClock(SET_US, LATEST_US)
    autopilot.talks(clock, 0.0, 3.0)
    now = autopilot.talks(clock, 3.0, 16.0, answers=False)
    line_error = autopilot.error(clock, now)
    assert 0 <= line_error - (down - SET_US) <= 200e-6 * 14e6 + max(SET_US - down - up, 0) + 2


@LAWS
@given(down=DELAYS, up=DELAYS, step=st.integers(1_000, 1_900_000))
def test_an_answer_from_before_a_clock_was_set_forward_counts_no_more(down, up, step):
    autopilot, clock = Autopilot(down, up), SenderClock(SET_US, LATEST_US)
    autopilot.talks(clock, 0.0, 3.0)
    autopilot.step = step
    now = autopilot.talks(clock, 3.02, 3.5)
    # A step that is shorter than the time that an answer took cannot be told from its delay, nor one that the
    # clock may have gained since.
    assert abs(autopilot.error(clock, now)) <= max(down, up, SET_US) + 0.01 * 1.5e6
    now = autopilot.talks(clock, 4.0, 5.0)
    if step > down + up + 2_000:
        assert abs(autopilot.error(clock, now)) <= 0.5 * abs(down - up) + 500


@LAWS
@given(down=DELAYS, up=DELAYS, later=st.integers(0, 200_000), lost=st.integers(1_000, 1_900_000))
def test_a_clock_that_stood_is_read_as_before_after_the_next_answer(down, up, later, lost):
    """The answer may be later than the ones before: those do not agree with it if the clock stood long."""
    autopilot, clock = Autopilot(down, up), SenderClock(SET_US, LATEST_US)
    autopilot.talks(clock, 0.0, 3.0)
    autopilot.step, autopilot.up = -lost, up + later
    now = autopilot.talks(clock, 3.0, 5.0)
    error = abs(autopilot.error(clock, now))
    if lost > down + up + later:
        assert error <= 0.5 * abs(down - autopilot.up) + 1_000
    else:
        assert error <= down + autopilot.up + 1_000


@LAWS
@given(down=DELAYS, up=DELAYS, loses=numbers(0.001, 0.015))
def test_a_slow_clock_is_read_too_early_by_no_more_than_it_loses_between_answers(down, up, loses):
    autopilot, clock = Autopilot(down, up, -loses), SenderClock(SET_US, LATEST_US)
    now = autopilot.talks(clock, 0.0, 9.5)
    most = 0.5e6 * loses + 0.5 * abs(down - up) + 1_000
    assert abs(autopilot.error(clock, now)) <= most


@LAWS
@given(down=DELAYS, up=DELAYS)
def test_for_a_clock_that_may_stop_the_delay_is_the_one_that_is_set(down, up):
    autopilot, clock = Autopilot(down, up), SenderClock(SET_US, LATEST_US)
    autopilot.talks(clock, 0.0, 3.0)
    clock.brief = True
    autopilot.step = -200_000
    now = autopilot.talks(clock, 3.0, 4.0)
    assert autopilot.error(clock, now) == down - SET_US


def test_a_companion_with_a_camera_asks_once_a_second_though_nothing_is_late():
    trips = RoundTrips(OWN, regular=True)
    asked = [question for k in range(300) for question in trips.due(NOW + 10_000 * k, 0)]
    assert len(asked) == 3
    question = asked[0]
    assert trips.receive(Timesync(AUTOPILOT, 5_000_000_123, question.ts1)) == (NOW, 5_000_000)
