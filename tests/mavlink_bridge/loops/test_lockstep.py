"""Laws of lock-step: due times, no sight of the present tick, independence of the order of nodes."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.errors import ScheduleError
from mavlink_bridge.loops.lockstep import LockStep, Scheduled
from mavlink_bridge.network.simulated import Channel, Faults, SimulatedNetwork
from tests.mavlink_bridge.chatter import TICK, Chatter
from tests.mavlink_bridge.watching import Event, Watcher

CLEAN = Faults()


def crew(names: str, period: int = 4 * TICK) -> list[Scheduled]:
    return [Scheduled(Chatter(name), period, index * TICK) for index, name in enumerate(names)]


def air(scheduled: list[Scheduled], faults: Faults = CLEAN) -> SimulatedNetwork:
    return SimulatedNetwork(
        [Channel("air", {entry.node.name: "swarm" for entry in scheduled}, faults)], 3, TICK
    )


@given(
    st.lists(st.tuples(st.integers(1, 12), st.integers(0, 12)), min_size=1, max_size=5),
    st.lists(st.integers(0, 200_000), max_size=4),
)
def test_nodes_step_at_phase_plus_multiples_of_their_period(
    plans: list[tuple[int, int]], stops: list[int]
) -> None:
    scheduled = [
        Scheduled(Chatter(str(index)), period * TICK, phase * TICK)
        for index, (period, phase) in enumerate(plans)
    ]
    loop = LockStep(scheduled, air(scheduled), TICK)
    ticks: list[int] = []
    for stop in [*sorted(stops), 200_000]:
        loop.run(stop, ticks.append)
        assert loop.now == stop
    for node, period, phase, _ in scheduled:
        assert isinstance(node, Chatter)
        assert node.steps == list(range(phase, 200_000, period))
    assert ticks == sorted({step for entry in scheduled for step in entry.node.steps})  # type: ignore[attr-defined]


def test_no_node_sees_what_another_sends_on_the_same_tick() -> None:
    scheduled = [Scheduled(Chatter(name), TICK, 0) for name in "ab"]
    LockStep(scheduled, air(scheduled), TICK).run(10 * TICK)
    for node, *_ in scheduled:
        assert isinstance(node, Chatter)
        assert [now - int.from_bytes(data[:8], "big") for now, data in node.received] == [TICK] * 9


def flight(order: list[int]) -> tuple[list[Event], tuple[int, ...]]:
    everyone = [
        Scheduled(Chatter(f"n{index}"), (1 + index % 3) * TICK, index % 2 * TICK) for index in range(6)
    ]
    scheduled = [everyone[index] for index in order]
    watcher = Watcher()
    network = air(scheduled, Faults(delay=3000, jitter=9000, loss=0.1, duplication=0.1, reordering=0.1))
    LockStep(scheduled, network, TICK, [watcher]).run(60 * TICK)
    return watcher.events, tuple(network.counters)


@given(st.permutations(range(6)))
@settings(max_examples=15)
def test_the_order_of_nodes_changes_no_byte(order: list[int]) -> None:
    assert flight(order) == flight(list(range(6)))


def test_taps_see_all_that_enters_and_leaves() -> None:
    scheduled = crew("abc")
    watcher = Watcher()
    LockStep(scheduled, air(scheduled), TICK, [watcher]).run(100 * TICK)
    seen = watcher.events
    for node, *_ in scheduled:
        assert isinstance(node, Chatter)
        assert [now for now, name in watcher.steps if name == node.name] == node.steps
        mine = [event for event in seen if event[1] == node.name]
        assert [(now, datagram.data) for now, _, way, datagram in mine if way == "in"] == node.received
        assert [now for now, _, way, _ in mine if way == "out"] == node.steps
    assert [event[0] for event in seen] == sorted(event[0] for event in seen)


def test_on_tick_may_end_the_run_and_it_can_go_on() -> None:
    scheduled = crew("ab")
    node = scheduled[0].node
    assert isinstance(node, Chatter)
    loop = LockStep(scheduled, air(scheduled), TICK)
    loop.run(100 * TICK, lambda now: now >= 8 * TICK)
    assert node.steps == [0, 4 * TICK, 8 * TICK]
    assert loop.now == 8 * TICK + 1
    loop.run(13 * TICK)
    assert node.steps == [0, 4 * TICK, 8 * TICK, 12 * TICK]


def test_a_clock_that_goes_on_for_long_without_anyone_due_costs_nothing() -> None:
    scheduled = [Scheduled(Chatter("a"), 4 * 10**12, 0)]
    loop = LockStep(scheduled, air(scheduled), 4)
    loop.run(10**13)
    assert loop.now == 10**13


@pytest.mark.parametrize(
    ("period", "phase", "tick"),
    [
        (0, 0, 2500),
        (-2500, 0, 2500),
        (3000, 0, 2500),
        (2500, 100, 2500),
        (2500, -2500, 2500),
        (2502, 0, 2502),
        (4, 0, 0),
    ],
)
def test_what_is_off_the_grid_is_refused(period: int, phase: int, tick: int) -> None:
    scheduled = [Scheduled(Chatter("a"), period, phase)]
    with pytest.raises(ScheduleError):
        LockStep(scheduled, air(scheduled), tick)


def test_names_are_unique() -> None:
    names = list("aba")
    random.Random(1).shuffle(names)
    scheduled = crew("".join(names))
    with pytest.raises(ScheduleError, match="'a'"):
        LockStep(scheduled, air(scheduled), TICK)
