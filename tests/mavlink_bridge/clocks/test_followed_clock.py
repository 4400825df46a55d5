"""Laws of a clock that follows another: it shows what that shows, whatever its rate, and never goes back."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.clocks.followed_clock import FollowedClock

SECOND = 1_000_000


class Sender:
    """Sends its time at 50 Hz of its own; each takes ``delay`` µs of the wall and up to ``jitter`` more, and
    is read when someone looks, every ``look`` µs."""

    def __init__(self, rate, *, boot=7 * SECOND, delay=2_000, jitter=10_000, look=20_000, seed=0):
        self.rate, self.boot = rate, boot
        self._delay, self._jitter, self._look = delay, jitter, look
        self._random = random.Random(seed)
        self._sent = -1

    def time(self, wall):
        return self.boot + int(self.rate * wall)

    def follow(self, wall_clock, followed, seconds, observer=None):
        """Let ``seconds`` of the wall pass; what ``observer(wall)`` sees."""
        if self._sent < 0:
            self._sent = round(wall_clock.now() * self.rate / 20_000)
        end = wall_clock.now() + round(seconds * SECOND)
        waiting = []
        while wall_clock.now() < end:
            wall = wall_clock.now()
            while self._sent * 20_000 / self.rate <= wall:
                left = self._sent * 20_000 / self.rate
                arrives = left + self._delay + self._random.random() * self._jitter
                waiting.append((arrives, self.time(left)))
                self._sent += 1
            for arrives, stamp in [pair for pair in waiting if pair[0] <= wall]:
                followed.observe(wall, stamp // 1000 * 1000)
                waiting.remove((arrives, stamp))
            if observer is not None:
                observer(wall)
            wall_clock.wait_until(wall + self._look)


@given(
    rate=st.sampled_from((0.5, 0.99, 1.0, 1.0002, 1.011, 5.0, 10.0)),
    seed=st.integers(0, 50),
    jitter=st.integers(0, 30_000),
)
@settings(max_examples=40, deadline=None)
def test_it_shows_what_the_sender_shows_at_any_rate(rate, seed, jitter):
    wall = SimulatedClock(123 * SECOND)
    sender = Sender(rate, jitter=jitter, seed=seed)
    clock = FollowedClock(wall, begin=1000)
    sender.follow(wall, clock, 8.0)
    begin = sender.time(wall.now()) - clock.now()
    off = []
    sender.follow(wall, clock, 20.0, lambda t: off.append(sender.time(t) - clock.now() - begin))
    # What is looked at every 20 ms is known no better, as the sender counts time.
    assert max(abs(value) for value in off) <= rate * (2 * 20_000 + jitter)
    assert clock.rate == pytest.approx(rate, rel=0.01)
    assert clock.steps == 0


@pytest.mark.parametrize("rate", [1.0, 10.0])
def test_it_never_goes_back_and_goes_on_when_the_sender_began_anew(rate):
    wall = SimulatedClock(SECOND)
    clock = FollowedClock(wall)
    shown = []
    sender = Sender(rate)
    sender.follow(wall, clock, 5.0, lambda _t: shown.append(clock.now()))
    again = Sender(rate, boot=-round(rate * wall.now()))
    again.follow(wall, clock, 5.0, lambda _t: shown.append(clock.now()))
    assert clock.steps == 1
    steps = [b - a for a, b in pairwise(shown)]
    assert min(steps) >= 0
    # It did not stand still either, for longer than it takes to believe it.
    assert max(steps) <= rate * 60_000
    assert sum(steps) == pytest.approx(rate * 10 * SECOND, rel=0.2)


def test_one_stamp_that_is_damaged_changes_nothing():
    wall = SimulatedClock(SECOND)
    clock = FollowedClock(wall)
    sender = Sender(1.0)
    sender.follow(wall, clock, 4.0)
    before = clock.now()
    for stamp in (0, 1 << 40, 3, 1 << 31):
        clock.observe(wall.now(), stamp)
    assert clock.now() == before
    assert clock.steps == 0


def test_without_a_sender_it_runs_as_the_wall_does():
    wall = SimulatedClock(SECOND)
    clock = FollowedClock(wall, begin=40)
    clock.wait_until(5 * SECOND)
    assert clock.now() == 5 * SECOND
    assert wall.now() == pytest.approx(6 * SECOND - 40, abs=2)


@pytest.mark.parametrize("rate", [1.0, 10.0])
def test_it_waits_as_long_as_the_sender_takes(rate):
    wall = SimulatedClock(SECOND)
    clock = FollowedClock(wall)
    Sender(rate).follow(wall, clock, 6.0)
    began, shown = wall.now(), clock.now()
    clock.wait_until(shown + SECOND)
    assert wall.now() - began == pytest.approx(SECOND / rate, rel=0.02)
    assert clock.now() >= shown + SECOND


@given(
    rate=st.sampled_from((0.5, 2.0, 5.0, 10.0, 0.99, 1.0, 1.0002, 1.011)),
    seed=st.integers(0, 50),
    jitter=st.integers(0, 30_000),
)
@settings(max_examples=30, deadline=None)
def test_a_simulation_is_told_by_its_rate_and_a_real_clock_is_the_walls_from_then_on(rate, seed, jitter):
    wall = SimulatedClock(SECOND)
    clock = FollowedClock(wall, simulated=None)
    sender = Sender(rate, jitter=jitter, seed=seed)
    shown = []
    sender.follow(wall, clock, 9.9, lambda _t: shown.append((clock.now(), clock.known)))
    assert not any(known for _, known in shown)
    sender.follow(wall, clock, 22.0, lambda _t: shown.append((clock.now(), clock.known)))
    assert clock.known
    assert all(b >= a for (a, _), (b, _) in pairwise(shown))
    assert clock.simulated == (abs(rate - 1.0) > 0.005)
    if not clock.simulated:
        assert clock.rate == 1.0
        offset = clock.now() - wall.now()
        # Whatever its stamps do then.
        sender.rate, sender.boot = 0.9, sender.boot + 3 * SECOND
        sender.follow(wall, clock, 20.0, lambda t: shown.append((clock.now() - t, True)))
        assert {offset} == {shown for shown, _ in shown[-100:]}


@pytest.mark.parametrize("growth", [0.01, 0.05])
@pytest.mark.parametrize("end", [0.3, 1.0])
def test_a_queue_that_grows_before_anybody_decides_is_no_simulation(growth, end):
    """No queue grows for ever."""
    wall = SimulatedClock(SECOND)
    clock = FollowedClock(wall, simulated=None)
    began = sent = SECOND
    while wall.now() < 40 * SECOND:
        while sent + min(growth * (sent - began), end * SECOND * growth / 0.05) <= wall.now():
            clock.observe(wall.now(), sent)
            sent += 20_000
        wall.wait_until(wall.now() + 10_000)
    assert clock.known
    assert not clock.simulated


def decided(rate, there, back, *, asked=True):
    """A clock that has followed one of this ``rate`` for 45 s: stamps, at 50 Hz, and answers, five times a
    second, come ``back(t)`` s after they left, and requests reach it after ``there(t)`` s."""
    wall = SimulatedClock(SECOND)
    clock = FollowedClock(wall, simulated=None)
    began = sent = request = SECOND
    under_way = []
    while wall.now() < began + 45 * SECOND:
        now = wall.now()
        while sent <= now:
            arrives = sent + round(back((sent - began) * 1e-6) * SECOND)
            under_way.append((arrives, round(rate * sent), None))
            sent += 20_000
        if asked and request <= now:
            reached = now + round(there((now - began) * 1e-6) * SECOND)
            arrives = reached + round(back((reached - began) * 1e-6) * SECOND)
            under_way.append((arrives, round(rate * reached), now))
            request += 200_000
        for _, stamp, since in sorted((one for one in under_way if one[0] <= now), key=lambda one: one[:2]):
            if since is None:
                clock.observe(now, stamp)
            else:
                clock.answered(since, now, stamp)
        under_way = [one for one in under_way if one[0] > now]
        wall.wait_until(now + 10_000)
    assert clock.known
    return clock


@pytest.mark.parametrize("growth", [-0.02, 0.006, 0.01, 0.05, 0.15, 0.3])
@pytest.mark.parametrize("both", [False, True])
def test_a_delay_that_grows_evenly_is_no_simulation_if_the_autopilot_answers(growth, both):
    """For as long as anybody looks, on the way back or on both: stamps alone show a clock of another rate."""
    begin = 1.0 if growth < 0 else 0.02

    def back(t):
        return begin + growth * t

    assert not decided(1.0, back if both else lambda _t: 0.02, back).simulated


@pytest.mark.parametrize("rate", [0.5, 0.98, 0.99, 1.011, 1.02, 5.0])
@pytest.mark.parametrize("asked", [False, True])
def test_a_simulation_is_known_as_one_though_it_answers(rate, asked):
    clock = decided(rate, lambda _t: 0.02, lambda t: 0.02 + 0.02 * math.sin(3.0 * t) ** 2, asked=asked)
    assert clock.simulated


@given(
    shape=st.sampled_from(("sine", "steps", "rising", "falling")),
    swing=st.floats(0.02, 0.45),
    period=st.floats(0.3, 8.0),
)
@example(shape="sine", swing=0.2, period=3.0)
@example(shape="steps", swing=0.3, period=5.0)
@example(shape="steps", swing=0.375, period=0.3125)
@settings(max_examples=30, deadline=None)
def test_a_real_clock_is_known_however_the_delay_of_its_stamps_swings(shape, swing, period):
    """By less than half a second: a rate that was learnt from one swing does not make the next a stall."""
    wall = SimulatedClock(20 * SECOND)
    clock = FollowedClock(wall, simulated=None)
    shapes = {
        "sine": lambda turns: 0.5 + 0.5 * math.sin(2.0 * math.pi * turns),
        "steps": lambda turns: float(turns % 2.0 >= 1.0),
        "rising": lambda turns: turns % 1.0,
        "falling": lambda turns: 1.0 - turns % 1.0,
    }
    sent = began = wall.now()
    while wall.now() < began + 40 * SECOND and not clock.known:
        # In order, as on a stream: each comes after the one before.
        while sent + swing * SECOND * shapes[shape]((sent - began) / (period * SECOND)) <= wall.now():
            clock.observe(wall.now(), sent)
            sent += 20_000
        wall.wait_until(wall.now() + 10_000)
    assert clock.known
    assert not clock.simulated


def test_a_simulation_that_stands_at_times_is_known_as_one():
    wall = SimulatedClock(20 * SECOND)
    clock = FollowedClock(wall, simulated=None)
    sender = Sender(5.0)
    for _ in range(5):
        sender.follow(wall, clock, 3.0)
        # It never makes up for a tenth of a second in which it stood.
        wall.wait_until(wall.now() + SECOND // 10)
        sender.boot -= SECOND // 2
    sender.follow(wall, clock, 3.0)
    assert clock.known
    assert clock.simulated


def test_a_backlog_that_comes_at_once_is_no_simulation():
    """What waited somewhere before anybody listened."""
    wall = SimulatedClock(20 * SECOND)
    clock = FollowedClock(wall, simulated=None)
    for k in range(50):
        clock.observe(wall.now(), 15 * SECOND + k * 100_000)
        wall.wait_until(wall.now() + 10_000)
    Sender(1.0, boot=0).follow(wall, clock, 15.0)
    assert clock.known
    assert not clock.simulated
