"""Whose time a companion lives by: what is old on a real autopilot's link looks old."""

from __future__ import annotations

import time

import numpy as np
import pytest

from companion.config import CompanionConfig
from companion.estimation.tracks import Track
from companion.node import Companion
from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.clocks.followed_clock import FollowedClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import GpsGlobalOrigin, Heartbeat, LocalPosition, Source, Timesync
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from outrider.onboard.status import judgement
from outrider.supervision.supervised_node import SupervisedNode

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


@pytest.mark.parametrize(("rate", "growth"), [(1.0, 0.02), (0.98, 0.0), (1.0, 0.0)])
def test_the_companion_asks_for_the_autopilots_time_until_its_kind_of_clock_is_known(rate, growth):
    """Of an autopilot whose messages come ever later; stamps alone cannot tell it from a slow simulation."""
    wall, codec, own = SimulatedClock(1_000 * SECOND), Codec(), Source(1, 1)
    companion = Companion(CompanionConfig(), 1, 100, FleetFrame(47.4, 8.5, 488.0), time.thread_time_ns)
    followed = FollowedClock(wall, wall.now(), simulated=None)
    node = SupervisedNode(companion, wall, followed, None)
    began, under_way, asked = wall.now(), [], []
    while wall.now() < began + 35 * SECOND:
        now = wall.now()
        due = [data for arrives, data in under_way if arrives <= now]
        under_way = [one for one in under_way if one[0] > now]
        leaving = node.step(followed.now(), [Datagram("autopilot", data) for data in due])
        sent = [m for d in leaving if d.link == "autopilot" for m in Codec().feed(d.data)]
        requests = [message for message in sent if isinstance(message, Timesync)]
        asked += [now - began] * len(requests)
        stamp = 7 * SECOND + round(rate * (now - began))
        said = [Timesync(own, 1000 * stamp, message.ts1) for message in requests]
        said += [GpsGlobalOrigin(own, 47.4, 8.5, 488.0, stamp), Heartbeat(own, 2, 3, 0, 0, 3)]
        said.append(LocalPosition(own, stamp, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)))
        arrives = now + 20_000 + round(growth * (now - began))
        under_way += [(arrives, codec.encode(message)) for message in said]
        wall.wait_until(now + 50_000)
    assert followed.verdict is (rate != 1.0)
    assert len(asked) >= 10
    if rate == 1.0 and growth == 0.0:
        # A quick and real one is not asked any more.
        assert max(asked) < 11 * SECOND
