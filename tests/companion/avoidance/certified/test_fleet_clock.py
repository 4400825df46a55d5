"""Fleet time of a few companions: each within its bound of UTC, for any clocks, delays and a wrong source."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from itertools import count

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.avoidance.certified.fleet_clock import FleetClock, TimeTrouble
from companion.config.certified import CertifiedConfig, TimeSourcesConfig
from mavlink_bridge.clocks.system_clock import SystemTimeReading
from mavlink_bridge.messages import Source, Timesync, Tunnel
from mavlink_bridge.wire.fleet_time import PAYLOAD_TYPE, Estimate, FleetTime, pack, unpack

SECOND = 1_000_000
START = 1_767_225_600_000_000
TICK = 10_000
BOUND = 40_000
ACCURACY = 2_000
UTC = TimeSourcesConfig()


class Vehicle:
    """One companion, whose clock is ``ahead`` of UTC and drifts, with a system clock or without."""

    def __init__(
        self, system: int, ahead: int, drift: int, *, sourced: bool, config: CertifiedConfig
    ) -> None:
        self.system, self._ahead, self._drift = system, ahead, drift
        self.true = START
        self.sourced, self.shift = sourced, 0
        """``shift`` (µs): how far the system clock is off."""
        self.clock = FleetClock(config, Source(system, 195), self._read)
        self.free = True
        self.jumps = 0

    @property
    def now(self) -> int:
        return self.true + self._ahead + (self.true - START) * self._drift // SECOND

    def _read(self, now: int) -> SystemTimeReading | None:
        return SystemTimeReading(self.true - now + self.shift, ACCURACY) if self.sourced else None

    @property
    def off(self) -> int:
        """Its fleet time minus UTC, µs."""
        assert self.clock.ahead is not None
        return self.now + self.clock.ahead - self.true


class Fleet:
    """Companions on a channel with a delay (µs) of each message from ``delay``; False loses it."""

    def __init__(
        self,
        *vehicles: tuple[int, int, bool],
        delay: Callable[[], int | None] = lambda: 20_000,
        sources: TimeSourcesConfig = UTC,
    ) -> None:
        config = CertifiedConfig(fleet_time="measured", clock_us=BOUND, time_sources=sources)
        self.vehicles = [
            Vehicle(k, ahead, drift, sourced=sourced, config=config)
            for k, (ahead, drift, sourced) in enumerate(vehicles, 1)
        ]
        self._delay, self._true = delay, START
        self._number = count()
        self.forged: dict[int, Callable[[Timesync | Tunnel], Timesync | Tunnel]] = {}
        """What the messages of a vehicle are replaced by."""
        self._air: list[tuple[int, int, int, Timesync | Tunnel]] = []

    def run(self, seconds: float, check: Callable[[Vehicle], None] = lambda _vehicle: None) -> Fleet:
        end = self._true + round(seconds * SECOND)
        while self._true < end:
            self._true += TICK
            for vehicle in self.vehicles:
                vehicle.true = self._true
            while self._air and self._air[0][0] <= self._true:
                _, _, system, message = heappop(self._air)
                for vehicle in self.vehicles:
                    if vehicle.system == system:
                        vehicle.clock.receive(vehicle.now, "swarm", message)
            for vehicle in self.vehicles:
                vehicle.jumps += vehicle.clock.step(vehicle.now, free=vehicle.free)
                for message in vehicle.clock.messages(vehicle.now):
                    assert isinstance(message, Timesync | Tunnel)
                    self._send(vehicle, self.forged.get(vehicle.system, _as_it_is)(message))
                check(vehicle)
        return self

    def _send(self, sender: Vehicle, message: Timesync | Tunnel) -> None:
        for vehicle in self.vehicles:
            delay = self._delay()
            if vehicle is not sender and delay is not None:
                heappush(self._air, (self._true + delay, next(self._number), vehicle.system, message))


def _as_it_is(message: Timesync | Tunnel) -> Timesync | Tunnel:
    return message


def within_bound(vehicle: Vehicle) -> None:
    if vehicle.clock.trouble is None:
        assert abs(vehicle.off) <= vehicle.clock.error <= BOUND


offsets = st.integers(-600 * SECOND, 600 * SECOND)
drifts = st.integers(-50, 50)


@settings(deadline=None, max_examples=25)
@given(st.data(), st.lists(st.tuples(offsets, drifts, st.booleans()), min_size=1, max_size=4))
def test_whoever_calls_its_time_good_is_within_the_bound(
    data: st.DataObject, vehicles: list[tuple[int, int, bool]]
) -> None:
    random = data.draw(st.randoms(use_true_random=False))
    fleet = Fleet(*vehicles, delay=lambda: None if random.random() < 0.3 else random.randrange(0, 120_000))
    fleet.run(6.0, within_bound)
    # Of three sources one may be wrong: then two others count, across links whose delays are too long here.
    if sum(sourced for _, _, sourced in vehicles) <= 2:
        assert all(vehicle.clock.trouble is None for vehicle in fleet.vehicles if vehicle.sourced)


def test_clocks_that_are_off_by_minutes_and_drift_agree_and_do_not_jump_again() -> None:
    fleet = Fleet((240 * SECOND, 50, True), (-300 * SECOND, -50, True), (0, 50, False)).run(5.0)
    for vehicle in fleet.vehicles:
        assert (vehicle.clock.trouble, vehicle.jumps) == (None, 1)
        vehicle.free = False
    fleet.run(60.0, within_bound)
    assert all((v.clock.trouble, v.jumps) == (None, 1) for v in fleet.vehicles)
    # The one without a source knows it within half a round trip of 60 ms or so.
    assert 20_000 <= fleet.vehicles[2].clock.error <= BOUND


def test_fleet_time_never_runs_back_nor_by_more_than_a_hundredth_faster() -> None:
    fleet = Fleet((0, 0, True), (0, 0, True)).run(3.0)
    last: dict[int, tuple[int, int]] = {}

    def smooth(vehicle: Vehicle) -> None:
        assert vehicle.clock.ahead is not None
        shown = vehicle.now + vehicle.clock.ahead
        true, before = last.get(vehicle.system, (vehicle.true - TICK, shown - TICK))
        passed = vehicle.true - true
        assert abs(shown - before - passed) <= passed // 100 + 1
        last[vehicle.system] = vehicle.true, shown

    for vehicle in fleet.vehicles:
        vehicle.free, vehicle.shift = False, 300_000
    fleet.run(1.0, smooth)
    assert {v.clock.trouble for v in fleet.vehicles} == {TimeTrouble.CORRECTING}
    fleet.run(40.0, smooth)
    assert {v.clock.trouble for v in fleet.vehicles} == {None}
    assert all(abs(v.off - 300_000) <= BOUND for v in fleet.vehicles)


def test_one_system_clock_of_three_that_steps_changes_nothing() -> None:
    fleet = Fleet(*[(k * SECOND, 0, True) for k in range(3)]).run(3.0)
    for vehicle in fleet.vehicles:
        vehicle.free = False
    fleet.vehicles[0].shift = 5 * SECOND
    fleet.run(20.0, within_bound)
    assert [v.clock.trouble for v in fleet.vehicles] == [None, None, None]
    assert all(abs(v.off) <= BOUND for v in fleet.vehicles)


def test_of_two_that_contradict_each_other_nobody_is_believed() -> None:
    fleet = Fleet((0, 0, True), (0, 0, True)).run(3.0)
    fleet.vehicles[0].shift = 5 * SECOND
    for vehicle in fleet.vehicles:
        vehicle.free = False
    fleet.run(3.0)
    assert {v.clock.trouble for v in fleet.vehicles} == {TimeTrouble.DISAGREE}
    assert all(abs(v.off) <= BOUND for v in fleet.vehicles)


def test_without_sources_it_is_not_known_and_when_they_end_it_is_kept_for_a_while() -> None:
    assert [v.clock.ahead for v in Fleet((0, 0, False), (0, 0, False)).run(3.0).vehicles] == [None, None]
    fleet = Fleet((0, 0, True)).run(1.0)
    (vehicle,) = fleet.vehicles
    vehicle.sourced = False
    # (40 − 2) ms at 100 ppm.
    fleet.run(375.0, within_bound)
    assert vehicle.clock.trouble is None
    fleet.run(10.0)
    assert vehicle.clock.trouble is TimeTrouble.NO_SOURCE


def test_a_link_that_is_too_slow_leaves_too_much_uncertain() -> None:
    fleet = Fleet((0, 0, True), (90 * SECOND, 0, False), delay=lambda: 80_000).run(5.0)
    assert [v.clock.trouble for v in fleet.vehicles] == [None, TimeTrouble.UNCERTAIN]
    assert fleet.vehicles[1].clock.ahead is None


def test_the_clock_of_a_reference_is_fleet_time() -> None:
    fleet = Fleet(
        (100 * SECOND, 30, True), (-7 * SECOND, -50, True), sources=TimeSourcesConfig(reference=1)
    ).run(5.0)
    first, second = fleet.vehicles
    assert (first.clock.ahead, first.clock.trouble, second.clock.trouble) == (0, None, None)
    for vehicle in fleet.vehicles:
        vehicle.free = False
    fleet.run(30.0)
    assert second.clock.trouble is None
    assert second.clock.ahead is not None
    assert abs(second.now + second.clock.ahead - first.now) <= second.clock.error <= BOUND


def test_differences_of_fleet_times_hold_the_true_ones() -> None:
    fleet = Fleet((240 * SECOND, 50, True), (-300 * SECOND, -50, True)).run(8.0)
    first, second = fleet.vehicles
    bounds = first.clock.differences(first.now)[2]
    assert bounds.least <= second.off - first.off <= bounds.most
    assert bounds.most - bounds.least <= 2 * BOUND


@pytest.mark.parametrize("vehicles", [2, 3])
def test_a_peer_that_lies_about_its_bound_misleads_nobody(vehicles: int) -> None:
    """Beside one other source no time is believed, and plans are held; beside two it is left out."""
    fleet = Fleet(*[(0, 0, True)] * vehicles).run(3.0)
    for vehicle in fleet.vehicles:
        vehicle.free = False
    fleet.forged[1] = lambda message: (
        Tunnel(message.source, 0, 0, PAYLOAD_TYPE, pack(lied(message)))
        if isinstance(message, Tunnel)
        else message
    )
    fleet.run(5.0, within_bound)
    expected = TimeTrouble.DISAGREE if vehicles == 2 else None
    assert {v.clock.trouble for v in fleet.vehicles[1:]} == {expected}
    assert all(abs(v.off) <= BOUND for v in fleet.vehicles[1:])


def lied(message: Tunnel) -> FleetTime:
    """The fleet time of ``message`` with an estimate that is 5 s off, and said to be exact."""
    told = unpack(message.payload)
    return (
        told
        if told.estimate is None
        else told._replace(estimate=Estimate(told.estimate.ahead + 5 * SECOND, 0))
    )


@given(
    st.one_of(
        st.binary(max_size=128),
        st.builds(
            lambda time, ahead, estimate: pack(FleetTime(time, ahead, estimate)),
            st.integers(0, 2**56 - 1),
            st.none() | st.integers(-(2**63), 2**63 - 1),
            st.none() | st.builds(Estimate, st.integers(-(2**63), 2**63 - 1), st.integers(0, 2**32 - 1)),
        ),
    ),
    st.integers(-(2**63), 2**63 - 1),
)
@settings(deadline=None, max_examples=60)
def test_no_message_of_one_peer_ends_it_or_misleads_three(payload: bytes, tc1: int) -> None:
    fleet = Fleet(*[(0, 0, True)] * 3).run(2.0)
    for vehicle in fleet.vehicles:
        vehicle.free = False
        for _ in range(2):
            vehicle.clock.receive(vehicle.now, "swarm", Tunnel(Source(77, 195), 0, 0, PAYLOAD_TYPE, payload))
            asked = vehicle.now * 1000 + vehicle.system
            vehicle.clock.receive(vehicle.now, "swarm", Timesync(Source(77, 195), tc1, asked))
    fleet.run(1.0, within_bound)
    assert [v.clock.trouble for v in fleet.vehicles] == [None] * 3
    for vehicle in fleet.vehicles:
        told = [m for m in vehicle.clock.messages(vehicle.now + SECOND) if isinstance(m, Tunnel)]
        assert unpack(told[0].payload).ahead == vehicle.clock.ahead
