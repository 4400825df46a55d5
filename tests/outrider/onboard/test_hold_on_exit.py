"""The last word of a flight: only where the companion had the vehicle, and even in a hurry."""

from __future__ import annotations

import time

import pytest

from companion.flight.autopilots.ardupilot import ARDUPILOT
from companion.flight.hold_on_exit import HoldOnExit
from companion.node import Companion
from companion.values.phase import Phase
from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.links.link import memory_pair
from mavlink_bridge.messages import CommandLong, Heartbeat, Source
from mavlink_bridge.wire.codec import Codec
from outrider.onboard.hold_on_exit import farewell
from outrider.onboard.status import State
from outrider.scenarios.fly_config import FleetOrigin, FlyConfig
from outrider.supervision.supervised_node import OURS, SupervisedNode

BEAT = Heartbeat(Source(1, 1), 2, 3, 0x80, ARDUPILOT.guided_custom_mode, 4)
CONFIG = FlyConfig(system=1, target=100, origin=FleetOrigin(latitude=47.4, longitude=8.5, altitude=488.0))


def companion() -> Companion:
    return Companion(CONFIG.settings, 1, 100, FleetFrame(47.4, 8.5, 488.0), time.thread_time_ns)


@pytest.mark.parametrize("phase", list(Phase), ids=lambda phase: phase.value)
def test_a_companion_that_gives_up_asks_where_it_had_the_vehicle(phase: Phase) -> None:
    """A ground station may fly it in the same mode, before a go and after a take-over."""
    node = companion()
    node.pilot.receive(BEAT)
    node.pilot.phase = phase
    supervised = SupervisedNode(node, SimulatedClock(1), None, None)
    supervised.give_up()
    told = supervised.step(1_000, [])
    ours = phase not in (Phase.CONNECT, Phase.YIELDED, Phase.DONE)
    assert bool(told) == ours
    assert State(phase=phase.value).ours == ours == (phase in OURS)


def test_it_is_said_even_in_a_hurry() -> None:
    """Whoever signals twice is heard, after the vehicle was asked."""
    here, there = memory_pair()
    clock = SimulatedClock(5_000_000)
    word = HoldOnExit(1, BEAT)
    farewell(word, here, clock, lambda: True)
    received = [message for data in there.receive() for message in Codec().feed(data)]
    assert len([m for m in received if isinstance(m, CommandLong) and m.command == 176]) >= 2
    assert clock.now() - 5_000_000 < 1_000_000


def test_it_takes_its_time_otherwise() -> None:
    here, there = memory_pair()
    clock = SimulatedClock(5_000_000)
    word = HoldOnExit(1, BEAT)

    def hurry() -> bool:
        if clock.now() > 6_000_000 and not word.over:
            there.send(Codec().encode(BEAT._replace(custom_mode=17)))
        return False

    farewell(word, here, clock, hurry)
    assert word.said == "holds (BRAKE)"
