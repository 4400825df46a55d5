"""Whose time a companion lives by: what is old on a real autopilot's link looks old."""

from __future__ import annotations

import numpy as np
import pytest

from companion.config import CompanionConfig
from companion.estimation.tracks import Track
from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.clocks.followed_clock import FollowedClock
from outrider.onboard.status import judgement

SECOND = 1_000_000
PERIOD = 20_000


def ages(delay, seconds=45.0):
    """True and shown age (µs) of the own state, after a quarter of a minute without delay; ``delay(s)``: of
    the link, s."""
    wall = SimulatedClock(1_000 * SECOND)
    clock, track = FollowedClock(wall, wall.now(), simulated=None), Track(CompanionConfig().own)
    sent, found = wall.now(), []
    began = wall.now() + 15 * SECOND
    while wall.now() < began + seconds * SECOND:
        now = wall.now()
        while sent + round(1e6 * delay(max(sent - began, 0) * 1e-6)) <= now:
            clock.observe(now, sent)
            track.brief = clock.simulated
            track.measure(clock.now(), np.zeros(3), np.zeros(3), sent)
            newest, sent = sent, sent + PERIOD
        if clock.known and now > began:
            found.append((now - newest, track.at(clock.now()).age))
        wall.wait_until(now + 10_000)
    return found


@pytest.mark.parametrize(
    "delay",
    [lambda t: min(0.05 * t, 1.25), lambda t: 0.35 * min(t // 10, 4)],
    ids=["ramp of 50 ms/s", "steps of 0.35 s every ten seconds"],
)
def test_the_own_state_looks_as_old_as_it_is(delay):
    # As long as no clock can be told from it: then the track itself learns the rate (``timing``).
    found = ages(delay, 28.0)
    assert len(found) > 1000
    assert max(true for true, _ in found) > 0.7 * SECOND
    assert max(abs(true - shown) for true, shown in found) < 60_000


def test_what_the_clock_is_taken_for_is_said():
    assert "5.010 times" in judgement(5.01, simulated=True)
    assert "real" in judgement(1.0001, simulated=False)
    assert "clock: autopilot" in judgement(0.95, simulated=False)
