"""A process that stops inside its step for long tells no plan that was to begin meanwhile, and flies none."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.committed import carried_on
from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.certified.pair import Agreement
from companion.values.horizon import Array
from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.links.link import LinkCounters
from mavlink_bridge.loops.lockstep import Scheduled
from mavlink_bridge.loops.realtime import RealTime
from mavlink_bridge.messages import Tunnel
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE as PLAN
from mavlink_bridge.wire.plan import WirePlan, pack
from mavlink_bridge.wire.plan import unpack as unpack_plan
from outrider.onboard.copied_node import CopiedNode
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import TICK, Swarm
from tests.companion.avoidance.certified.two import LENGTH, NOW, OTHER, agreed, epoch, plan

STALL = 700_000
"""µs."""
UNTIL = 8_000_000
STARTS = np.array([[0.0, 0.0, 5.0], [6.0, 0.0, 5.0], [3.0, 5.0, 5.0]])
ROUGH = Rough(loss=0.2, delay=60_000)


def swap(since: int, system: int) -> Array:
    """Each goes to the next one's place, and after three seconds to the one after that."""
    return STARTS[(system + since // 3_000_000) % len(STARTS)]


def spans(first: int) -> tuple[tuple[int, int], ...]:
    """A stall each second and a bit, in different parts of the epoch; among them steps that make a plan."""
    return tuple((begin, begin + STALL) for begin in range(first, UNTIL - STALL, 1_130_000))


def stalling(seed: int) -> Swarm:
    habits = [Habits(stalls=spans(1_000_000 + 20_000 * seed)), Habits(), Habits(stalls=spans(1_350_000))]
    swarm = Swarm(STARTS, ROUGH, habits, seed)
    swarm.run(UNTIL, swap)
    return swarm


@pytest.mark.parametrize("seed", range(8))
def test_in_lock_step_it_goes_on_with_the_plan_that_its_backup_node_flies(seed: int) -> None:
    swarm = stalling(seed)
    assert not swarm.faults()
    assert all(len(swarm.vehicles[k].stalled) > 4 for k in (0, 2))
    assert any(made.found for made in swarm.vehicles[0].made)


def test_a_plan_that_is_not_recalled_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CertifiedFlight, "recall", lambda self: True)
    assert any("another plan than that of the backup node" in stalling(seed).faults() for seed in range(8))


def test_a_recalled_plan_that_stays_filed_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Agreements, "recall", lambda self, epoch: True)
    assert any("other plans than those that are flown" in stalling(seed).faults() for seed in range(8))


def test_what_is_recalled_never_was() -> None:
    """A plan is filed, an offer taken that replaces an agreement, and another one proposed."""
    two = agreed()
    mine, peer = two.first, two.first.peers.counted[OTHER]
    before = peer.pair.kept, peer.pair.considered, dict(peer.agreed), mine.plans.newest
    mine.made(plan(1))
    peer.agree(Agreement(epoch(0), epoch(1)), before[2][before[0][-1]])
    peer.propose(NOW, Agreement(epoch(1), epoch(1)), before[2][before[0][-1]])
    assert peer.pair.kept != before[0]
    assert mine.recall(epoch(1))
    assert (peer.pair.kept, peer.pair.considered, peer.agreed, mine.plans.newest) == before
    assert peer.changed
    assert peer.waiting(NOW) is None
    assert not mine.recall(epoch(1))


def test_nothing_is_recalled_once_a_message_was_received() -> None:
    two = agreed()
    two.first.made(plan(1))
    two.first.receive_plan(NOW + LENGTH, OTHER, pack(plan(1, 4.0)))
    assert not two.first.recall(epoch(1))


class Others(SimulatedClock):
    """A clock by which the other vehicles of ``swarm`` act whenever it advances."""

    def __init__(self, swarm: Swarm) -> None:
        super().__init__(EPOCH)
        self._swarm, self._done = swarm, 0

    def wait_until(self, instant: int) -> None:
        for since in range(self._done + TICK, instant - EPOCH + 1, TICK):
            self._done = since
            super().wait_until(EPOCH + since)
            for vehicle in self._swarm.vehicles[1:]:
                messages = vehicle.step(since, swap(since, vehicle.system))
                vehicle.note(messages)
                self._swarm.send(since, vehicle, messages)
                self._swarm.record(since, vehicle)
        super().wait_until(instant)


class Radio:
    """Link of the first vehicle of ``swarm`` to the others; it notes which plans were told."""

    counters = LinkCounters(0, 0, 0)

    def __init__(self, swarm: Swarm, clock: SimulatedClock) -> None:
        self._swarm, self._clock = swarm, clock
        self._codec = Codec()
        self.told: list[tuple[int, WirePlan]] = []
        """Plans, and when (µs of the run) each was told."""
        self.sent: list[Tunnel] = []
        """What was sent since this was last emptied."""

    def fileno(self) -> None:
        return None

    def receive(self) -> list[bytes]:
        return []

    def send(self, data: bytes) -> None:
        since = self._clock.now() - EPOCH
        messages = [message for message in self._codec.feed(data) if isinstance(message, Tunnel)]
        self._swarm.send(since, self._swarm.vehicles[0], messages)
        self.sent += messages
        plans = [unpack_plan(message.payload) for message in messages if message.payload_type == PLAN]
        self.told += [(since, plan) for plan in plans]

    def late(self) -> list[int]:
        """How long (µs) after its beginning each plan was told that is none of before, carried on."""
        found, known = [], {}
        for since, one in self.told:
            known.setdefault(one.epoch, one)
            before = known.get(max((epoch for epoch in known if epoch < one.epoch), default=0))
            carried = before and carried_on(before, (one.epoch - before.epoch) // before.dt)
            if known[one.epoch] is one and one != carried:
                found.append(since - (one.epoch - EPOCH))
        return found

    def close(self) -> None:
        return None


class Process:
    """Node of the first vehicle of ``swarm``, whose step lasts for ``STALL`` now and then.

    For ``CopiedNode`` it is the companion as well.
    """

    name, system = "companion-1", 1

    def __init__(self, swarm: Swarm, clock: SimulatedClock) -> None:
        self._vehicle, self._clock = swarm.vehicles[0], clock
        self._codec, self._stalls = Codec(), list(spans(1_000_000))
        self._began = 0
        self.config = swarm.config
        self.pilot = SimpleNamespace(vehicle=SimpleNamespace(heartbeat=None))
        self.world = SimpleNamespace(origin=None)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        self._began = since = now - EPOCH
        messages = self._vehicle.step(since, swap(since, self.system))
        if self._stalls and since >= self._stalls[0][0]:
            self._stalls.pop(0)
            self._clock.wait_until(now + STALL)
        self._vehicle.busy_until = self._clock.now() - EPOCH
        return [Datagram("swarm", self._codec.encode(message)) for message in messages]

    def recall(self) -> bool:
        return self._vehicle.recall(self._began)


def in_real_time(seed: int) -> tuple[Swarm, Radio]:
    """The first vehicle's loop under a clock that goes on while its process stops."""
    swarm = Swarm(STARTS, ROUGH, [Habits()] * len(STARTS), seed)
    clock, copies = Others(swarm), SimpleNamespace(send=lambda record: None)
    process, radio = Process(swarm, clock), Radio(swarm, clock)
    node: Any = process
    flying = CopiedNode(node, node, cast(Any, copies), clock)

    def noted(now: int) -> bool:
        swarm.vehicles[0].note(radio.sent)
        swarm.record(now - EPOCH, swarm.vehicles[0])
        radio.sent.clear()
        return now >= EPOCH + UNTIL

    loop = RealTime(Scheduled(flying, TICK, 4_000), {"swarm": radio}, clock)
    loop.run(lambda: False, noted)
    return swarm, radio


@pytest.mark.parametrize("seed", range(4))
def test_in_real_time_no_plan_is_told_that_has_begun(seed: int) -> None:
    swarm, radio = in_real_time(seed)
    assert not swarm.faults()
    assert len(swarm.vehicles[0].stalled) > 4
    assert max(radio.late()) <= TICK


def test_a_plan_that_is_told_late_is_found_in_real_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CertifiedFlight, "recall", lambda self: False)
    assert max(max(in_real_time(seed)[1].late()) for seed in range(4)) > STALL // 2
