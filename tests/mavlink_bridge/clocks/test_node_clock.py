"""Laws of nodes with clocks of their own: one deadline one call, no drift on the own clock, time never
decreases, and a clock that is right changes nothing."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.clocks.node_clock import NodeClock
from mavlink_bridge.errors import ScheduleError
from mavlink_bridge.loops.lockstep import LockStep, Scheduled
from mavlink_bridge.network.simulated import Channel, Faults, SimulatedNetwork
from tests.mavlink_bridge.chatter import TICK, Chatter
from tests.mavlink_bridge.watching import Event, Watcher

EPOCH = 1_767_225_600_000_000
SECOND = 1_000_000
PERIOD = 4 * TICK

offsets = st.integers(-10 * SECOND, 10 * SECOND)
drifts = st.floats(-100_000, 100_000) | st.floats(-50, 50)
clocks = st.builds(NodeClock, offsets, drifts, st.just(EPOCH))


def loop_of(*scheduled: Scheduled, tick: int = TICK) -> LockStep:
    names = {entry.node.name: "swarm" for entry in scheduled}
    faults = Faults(3000, 9000, 0.1, 0.1, 0.1)
    return LockStep(scheduled, SimulatedNetwork([Channel("air", names, faults)], 3, tick), tick)


# The clock


@given(clocks, st.integers(-(10**9), 10**12), st.integers(0, 10**9))
def test_a_clock_and_its_inverse(clock: NodeClock, since: int, later: int) -> None:
    true = EPOCH + since
    shown = clock.reading(true)
    assert clock.instant(shown) <= true < clock.instant(shown + 1)
    assert clock.reading(clock.instant(shown - 1) - 1) < shown - 1 <= clock.reading(clock.instant(shown - 1))
    assert clock.reading(true + later) >= shown
    local = clock.local(true)
    assert local % 4 == 0
    assert local <= shown < local + 4


@given(clocks, st.integers(0, 10**12))
def test_offset_and_drift_are_what_they_are_called(clock: NodeClock, since: int) -> None:
    off = clock.reading(EPOCH + since) - EPOCH - since
    assert abs(off - clock.offset - clock.drift_ppm * 1e-6 * since) <= 1 + 0.0005e-6 * since
    assert clock.reading(EPOCH) == EPOCH + clock.offset


@given(st.integers(0, 2**52), st.integers(0, 2**52))
def test_a_right_clock_shows_true_time(true: int, since: int) -> None:
    assert NodeClock(since=since).reading(true) == true == NodeClock(since=since).instant(true)


@pytest.mark.parametrize("drift", [100_001.0, -100_001.0, float("nan"), float("inf")])
def test_drifts_that_no_clock_has_are_refused(drift: float) -> None:
    with pytest.raises(ScheduleError, match="ppm"):
        NodeClock(0, drift)


# Calls by a clock


@given(clocks, st.integers(1, 6), st.integers(0, 5), st.sampled_from([4, 500, 2500]))
@settings(max_examples=60)
def test_one_call_for_each_deadline_on_the_own_clock(
    clock: NodeClock, ticks: int, phase: int, tick: int
) -> None:
    """Told at the first tick at which the clock shows it; none is left out unless the clock gains a whole
    period within a tick."""
    period, start, duration = ticks * tick, EPOCH + phase * tick, 200 * ticks * tick
    node = Chatter("a")
    calls: list[int] = []
    loop_of(Scheduled(node, period, start, clock), tick=tick).run(start + duration, calls.append)
    assert node.steps == [clock.local(call) for call in calls]
    assert calls[0] >= start
    assert calls[0] - start < clock.instant(clock.reading(start) + period) - start + tick
    assert all(call % tick == 0 for call in calls)
    for call in calls:
        past = (clock.reading(call) - start) % period
        assert past < clock.reading(call) - clock.reading(call - tick)
    deadlines = [(told - start) // period for told in node.steps]
    for before, after in pairwise(deadlines):
        assert after == before + 1 or (ticks == 1 and clock.drift_ppm > 0 and after == before + 2)
    expected = (clock.reading(start + duration) - clock.reading(start)) / period
    if ticks > 1:
        assert abs(len(calls) - expected) < 2


class Clerk(Watcher):
    """Notes the true time of each step."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: dict[str, list[int]] = {}
        self.loop: LockStep | None = None

    def begin(self, now: int, node: str, /) -> None:
        assert self.loop is not None
        self.seen.setdefault(node, []).append(self.loop.now)


def test_phases_of_two_clocks_wander() -> None:
    """40 ppm against each other are two ticks of 2500 µs in 125 s."""
    fast, slow = Chatter("fast"), Chatter("slow")
    clerk = Clerk()
    loop = LockStep(
        [
            Scheduled(fast, PERIOD, EPOCH, NodeClock(0, 20.0, EPOCH)),
            Scheduled(slow, PERIOD, EPOCH, NodeClock(0, -20.0, EPOCH)),
        ],
        SimulatedNetwork([], 1, TICK),
        TICK,
        [clerk],
    )
    clerk.loop = loop
    loop.run(EPOCH + 126 * SECOND)
    apart = [b - a for a, b in zip(clerk.seen["fast"], clerk.seen["slow"], strict=False)]
    assert apart == sorted(apart)
    # Both are due at the epoch; from then on the slow one comes too late for its tick.
    assert (apart[0], apart[1], apart[-1]) == (0, TICK, 3 * TICK)
    assert fast.steps[0] == slow.steps[0] == EPOCH


def story(clock: NodeClock | None, reverse: bool = False) -> list[Event]:
    names = "abcd"
    scheduled = [
        Scheduled(Chatter(name), PERIOD, EPOCH + index * TICK, clock if name in "bc" else None)
        for index, name in enumerate(names)
    ]
    watcher = Watcher()
    network = SimulatedNetwork(
        [Channel("air", dict.fromkeys(names, "swarm"), Faults(3000, 9000, 0.1, 0.1, 0.1))], 3, TICK
    )
    loop = LockStep(scheduled[::-1] if reverse else scheduled, network, TICK, [watcher])
    loop.run(EPOCH + 2 * SECOND)
    return watcher.events


def test_a_right_clock_changes_no_byte() -> None:
    assert story(NodeClock(0, 0.0, EPOCH)) == story(NodeClock()) == story(None)


@given(clocks)
@settings(max_examples=10)
def test_with_clocks_too_the_order_of_nodes_changes_nothing(clock: NodeClock) -> None:
    assert story(clock) == story(clock, reverse=True)


@given(clocks)
@settings(max_examples=10)
def test_the_clock_of_one_does_not_move_the_others(clock: NodeClock) -> None:
    for name in "ad":
        out = [now for now, node, way, _ in story(clock) if (node, way) == (name, "out")]
        assert out == [now for now, node, way, _ in story(None) if (node, way) == (name, "out")]


def test_a_negative_time_is_told_to_nobody() -> None:
    with pytest.raises(ScheduleError, match="a: its clock shows -7500 µs at 2500 µs"):
        loop_of(Scheduled(Chatter("a"), PERIOD, TICK, NodeClock(-10_000)))
