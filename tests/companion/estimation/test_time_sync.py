"""A slow clock is followed and a slow link is not taken for one: with the sender's answers, whatever clock
and delays do, no message is believed to be younger than it is, nor older than the question took."""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.estimation.sender_clock import SenderClock
from companion.estimation.time_sync import RoundTrips
from mavlink_bridge.messages import Source, Timesync
from tests.companion.rig import LAWS, QUICK, numbers

OWN, AUTOPILOT = Source(11, 195), Source(11, 1)
DELAY, LATEST = 20_000, 2_000_000
NOW = 1_767_225_600_000_000
SECOND = 1_000_000
TICK, PERIOD = 10_000, 20_000
DRIFT = 200e-6


class Seen(NamedTuple):
    """A message: when it came (s from the beginning), its true age and what it was said to be (µs)."""

    at: float
    true: int
    said: int


class Sender:
    """Its clock runs at ``rate`` of ours and stands for some µs at some times; it tells of itself every 20 ms
    of its own, and answers. Nothing overtakes anything on either way; delays (µs) by the time, s."""

    def __init__(self, rate, down, up, losses=(), answers=True):
        self._rate, self._down, self._up, self._losses = rate, down, up, losses
        self.answers = answers
        self.asked = 0

    def shows(self, t):
        """At ``t`` (µs of ours)."""
        lost = sum(min(max(t - 1e6 * at, 0.0), length) for at, length in self._losses)
        return 10 * SECOND + round(self._rate * (t - lost))

    def fly(self, seconds, clock):
        trips = RoundTrips(OWN)
        telling, asking = deque(), deque()
        told, last_down, last_up, next_stamp = [], 0, 0, self.shows(0)
        for now in range(0, round(1e6 * seconds), TICK):
            while asking and asking[0][0] <= now:
                left, question = asking.popleft()
                last_down = max(last_down, left + self._down(1e-6 * left))
                if self.answers:
                    answer = Timesync(AUTOPILOT, 1000 * self.shows(left), question.ts1)
                    telling.append((last_down, left, answer))
            if self.shows(now) >= next_stamp:
                next_stamp += PERIOD
                last_down = max(last_down, now + self._down(1e-6 * now))
                telling.append((last_down, now, self.shows(now)))
            while telling and telling[0][0] <= now:
                _, left, what = telling.popleft()
                if isinstance(what, Timesync):
                    answer = trips.receive(what)
                    clock.answered(NOW + now, *answer)
                else:
                    date = clock.date(NOW + now, what // 1000 * 1000)
                    if date is not None:
                        told.append(Seen(1e-6 * now, now - left, NOW + now - date.time - clock.skew))
            for question in trips.due(NOW + now, clock.late):
                self.asked += 1
                last_up = max(last_up, now + self._up(1e-6 * now))
                asking.append((last_up, question))
        return told


def quick(_t):
    return DELAY


def steps(levels, every):
    """The delay after five quick seconds, ``levels`` (µs) in turn, ``every`` s."""
    return lambda t: DELAY + (0 if t < 5.0 else levels[int((t - 5.0) / every) % len(levels)])


LEVELS = st.lists(st.integers(0, 900_000), min_size=1, max_size=8)


@QUICK
@given(
    rate=st.sampled_from([0.9, 0.94, 0.97, 0.99, 0.997, 1.0]),
    down=LEVELS,
    up=LEVELS,
    every=numbers(0.5, 9.0),
    losses=st.lists(st.tuples(numbers(6.0, 55.0), st.integers(0, 900_000)), max_size=4),
)
def test_no_message_is_believed_to_be_younger_than_it_is(rate, down, up, every, losses):
    sender = Sender(rate, steps(down, every), steps(up, 1.3 * every), losses)
    told = sender.fly(60.0, SenderClock(DELAY, LATEST))
    assert len(told) > 2000
    # What two quartzes may drift apart, and the grain of stamps and steps.
    assert max(seen.true - seen.said for seen in told) <= DRIFT * 60e6 + TICK + 1000


@QUICK
@given(
    rate=numbers(0.9, 1.0),
    down=LEVELS,
    up=st.integers(0, 300_000),
    every=numbers(1.0, 9.0),
)
def test_nor_older_than_the_question_took(rate, down, up, every):
    """A clock that is slow by up to a tenth, however the delay of its messages grows and shrinks."""
    sender = Sender(rate, steps(down, every), lambda _t: DELAY + up)
    told = sender.fly(60.0, SenderClock(DELAY, LATEST))
    # Looked at every 10 ms, asked five times a second, by eight messages, and by the way there and back.
    slow = (1.0 - rate) * (0.5e6 + max(down) + up)
    assert max(seen.said - seen.true for seen in told) <= DELAY + up + 30_000 + slow


@pytest.mark.parametrize("rate", [0.9, 0.94, 0.99, 0.998, 1.0, 1.0002, 1.01, 1.1])
def test_a_clock_at_any_rate_is_followed_all_the_time(rate):
    sender = Sender(rate, quick, quick)
    told = sender.fly(180.0, SenderClock(DELAY, LATEST))
    off = np.array([seen.said - seen.true for seen in told])
    assert off.max() <= 75_000
    assert off.min() >= -DRIFT * 180e6
    # One that is as good as ours is asked for nothing.
    assert (sender.asked == 0) == (rate >= 0.9998)


@LAWS
@given(when=numbers(6.0, 8.0), lost=st.integers(50_000, 1_800_000))
def test_what_a_clock_loses_at_once_is_made_good_within_half_a_second(when, lost):
    clock = SenderClock(DELAY, LATEST)
    told = Sender(1.0, quick, quick, [(when, lost)]).fly(12.0, clock)
    after = [seen for seen in told if seen.at > when + 1e-6 * lost + 0.5]
    assert len(after) > 50
    assert max(abs(seen.said - seen.true) for seen in after) <= DELAY + TICK
    assert clock.lost == pytest.approx(lost, abs=2 * DELAY)


@pytest.mark.parametrize("growth", [0.005, 0.01, 0.02])
def test_a_delay_that_grows_evenly_for_minutes_is_seen_to_grow(growth):
    """Without answers it would be taken for a slow clock after half a minute."""

    def grows(t):
        return DELAY + round(1e6 * growth * max(t - 5.0, 0.0))

    said = []
    for answers in (True, False):
        clock = SenderClock(DELAY, LATEST)
        told = Sender(1.0, grows, quick, answers=answers).fly(95.0, clock)
        said.append(told[-1].said / told[-1].true)
    assert said[0] == pytest.approx(1.0, abs=0.06)
    assert said[1] < 0.5


def test_an_answer_from_another_clock_counts_for_nothing():
    """As of one who answers by Unix time, or from before the autopilot began anew."""
    clock = SenderClock(DELAY, LATEST)
    for k in range(200):
        now = NOW + k * PERIOD
        clock.date(now + DELAY, 10 * SECOND + k * PERIOD)
        for stamp in (now, 1, 10 * SECOND + k * PERIOD + 3 * SECOND, 10 * SECOND - 3 * SECOND):
            before = clock.skew
            clock.answered(now + DELAY, now, stamp)
            assert clock.skew == before
    assert clock.lost == 0


def test_an_answer_makes_nothing_younger_than_the_quickest_message():
    """Where the way there is quicker than the least delay that is set."""
    clock = SenderClock(DELAY, LATEST)
    for k in range(200):
        sent = k * PERIOD
        date = clock.date(NOW + sent + 2000, 10 * SECOND + sent)
        clock.answered(NOW + sent + 2000, NOW + sent, 10 * SECOND + sent + 1000)
        assert date.time + clock.skew == pytest.approx(NOW + sent + 2000 - DELAY, abs=1000)
    assert clock.lost == 0


@LAWS
@given(ahead=st.integers(0, 1_900_000))
def test_a_forged_answer_is_undone_by_the_next_message(ahead):
    """On a link that is not signed."""
    clock = SenderClock(DELAY, LATEST)
    for k in range(100):
        sent = k * PERIOD
        date = clock.date(NOW + sent + DELAY, 10 * SECOND + sent)
        assert date.time + clock.skew == pytest.approx(NOW + sent, abs=1000)
        clock.answered(NOW + sent + DELAY, NOW + sent, 10 * SECOND + sent - ahead)


def test_questions_are_asked_only_while_messages_are_late_and_each_answer_counts_once():
    trips = RoundTrips(OWN)
    asked = [message for k in range(300) for message in trips.due(NOW + k * TICK, 0)]
    assert asked == []
    asked = [message for k in range(300) for message in trips.due(NOW + k * TICK, 30_000)]
    assert len(asked) == 15
    assert len({message.ts1 for message in asked}) == 15
    assert min(b.ts1 - a.ts1 for a, b in pairwise(asked)) == 200_000_000
    question = asked[3]
    for other in (
        question,
        Timesync(AUTOPILOT, 77, question.ts1 + 1),
        Timesync(AUTOPILOT, -5, question.ts1),
    ):
        assert trips.receive(other) is None
    answer = trips.receive(Timesync(AUTOPILOT, 5_000_000_123, question.ts1))
    assert answer == (NOW + 3 * 200_000, 5_000_000)
    assert trips.receive(Timesync(AUTOPILOT, 5_000_000_123, question.ts1)) is None


def test_who_does_not_answer_is_known_after_three_seconds():
    trips, known = RoundTrips(OWN), []
    for k in range(400):
        trips.due(NOW + k * TICK, 30_000)
        known.append(trips.unanswered(NOW + k * TICK))
    assert known.index(True) == 301
    trips.due(NOW + 4 * SECOND, 0)
    assert not trips.unanswered(NOW + 4 * SECOND)
