"""Laws of nodes that hang or vanish: they are not called, what waits for them is bounded, nobody else's calls
move, and no datagram goes uncounted."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.clocks.node_clock import NodeClock
from mavlink_bridge.errors import ScheduleError
from mavlink_bridge.loops.lockstep import LockStep, Scheduled
from mavlink_bridge.network.simulated import Channel, Faults, SimulatedNetwork
from tests.mavlink_bridge.chatter import TICK, Chatter

PERIOD = 2 * TICK
NAMES = "abc"


class Nodes:
    """Three that talk: a and b every other tick, c every third, by a clock that is fast."""

    def __init__(self, buffer: int = 256, faults: Faults | None = None, reverse: bool = False) -> None:
        self.nodes = {name: Chatter(name) for name in NAMES}
        scheduled = [
            Scheduled(self.nodes["a"], PERIOD, 0),
            Scheduled(self.nodes["b"], PERIOD, TICK),
            Scheduled(self.nodes["c"], 3 * TICK, 0, NodeClock(4000, 5000.0)),
        ]
        channel = Channel("air", dict.fromkeys(NAMES, "swarm"), Faults() if faults is None else faults)
        self.network = SimulatedNetwork([channel], 3, TICK)
        self.loop = LockStep(scheduled[::-1] if reverse else scheduled, self.network, TICK, (), buffer)

    def run(self, until: int) -> None:
        self.loop.run(until, self._balance)

    def _balance(self, _now: int) -> None:
        sent, delivered, dropped, duplicated, _ = self.network.counters
        assert sent + duplicated == delivered + dropped + self.network.under_way
        assert delivered == sum(len(node.received) for node in self.nodes.values())


def test_who_hangs_is_not_called_and_goes_on_with_all_that_waited() -> None:
    crew, free = Nodes(), Nodes()
    crew.run(100 * TICK)
    crew.loop.freeze("a")
    crew.run(200 * TICK)
    crew.loop.thaw("a")
    crew.run(300 * TICK)
    free.run(300 * TICK)
    a, a_free = crew.nodes["a"], free.nodes["a"]
    assert a.steps == [step for step in a_free.steps if not 100 * TICK <= step < 200 * TICK]
    assert crew.nodes["b"].steps == free.nodes["b"].steps
    assert crew.nodes["c"].steps == free.nodes["c"].steps
    # All that b and c said while a hung is heard at its first call after.
    first = [data for now, data in a.received if now == 200 * TICK]
    late = [data for now, data in a_free.received if 100 * TICK <= now <= 200 * TICK]
    assert [data[:8] for data in first] == [data[:8] for data in late]
    assert crew.network.counters.dropped == 0


@given(st.integers(0, 60), st.integers(0, 100))
@settings(max_examples=30)
def test_a_full_buffer_drops_the_newest(buffer: int, length: int) -> None:
    """One talks in every tick, one listens in every third and hangs for a while."""
    ears = []
    for hangs in (False, True):
        ear = Chatter("ear")
        network = SimulatedNetwork([Channel("air", {"mouth": "swarm", "ear": "swarm"})], 3, TICK)
        scheduled = [Scheduled(Chatter("mouth"), TICK), Scheduled(ear, 3 * TICK)]
        loop = LockStep(scheduled, network, TICK, (), buffer)
        loop.run(20 * TICK)
        if hangs:
            loop.freeze("ear")
        loop.run((20 + length) * TICK)
        loop.thaw("ear")
        loop.run(200 * TICK)
        ears.append(ear)
    free, hung = ears
    missed = [step for step in free.steps if step not in hung.steps]
    assert missed == [step for step in free.steps if 20 * TICK <= step < (20 + length) * TICK]
    back = missed[-1] + 3 * TICK if missed else 0
    received = [(now, data[:8]) for now, data in free.received]
    waited = [(back, data) for now, data in received if now in missed or now == back]
    expected = [entry for entry in received if entry[0] not in [*missed, back]] + waited[:buffer]
    assert [(now, data[:8]) for now, data in hung.received] == sorted(expected)
    assert network.counters.dropped == max(len(waited) - buffer, 0) * bool(missed)


def test_who_vanishes_is_silent_and_deaf_for_ever() -> None:
    crew, free = Nodes(), Nodes()
    for one in (crew, free):
        one.run(50 * TICK)
        one.loop.freeze("c")
        one.run(60 * TICK)
        if one is crew:
            one.loop.vanish("c")
        else:
            one.loop.thaw("c")
        one.run(200 * TICK)
    assert max(crew.nodes["c"].steps) < 50 * TICK
    assert all(crew.nodes[name].steps == free.nodes[name].steps for name in "ab")
    # Two others talk every other tick; what reached c after its last call is dropped but for what is on its
    # way.
    counters = crew.network.counters
    assert counters.dropped + crew.network.under_way > 145
    assert crew.network.under_way < 12
    crew.loop.thaw("c")
    crew.loop.freeze("c")
    crew.loop.thaw("c")
    crew.run(300 * TICK)
    assert max(crew.nodes["c"].steps) < 50 * TICK


def test_to_vanish_is_to_hang_for_ever_without_a_buffer() -> None:
    gone, hung = Nodes(), Nodes(0)
    for crew in (gone, hung):
        crew.run(60 * TICK)
    gone.loop.vanish("b")
    hung.loop.freeze("b")
    for until in range(61, 100):
        for crew in (gone, hung):
            crew.run(until * TICK)
        assert gone.network.counters == hung.network.counters
        assert gone.network.under_way == hung.network.under_way


events = st.lists(
    st.tuples(
        st.integers(0, 150),
        st.sampled_from(["freeze", "thaw", "vanish"]),
        st.sampled_from(NAMES),
    ),
    max_size=8,
)


def flight(what: list[tuple[int, str, str]], reverse: bool) -> tuple[object, ...]:
    crew = Nodes(5, Faults(3000, 9000, 0.1, 0.1, 0.1), reverse)
    for tick, action, name in sorted(what):
        crew.run(tick * TICK)
        getattr(crew.loop, action)(name)
    crew.run(200 * TICK)
    return [(node.steps, node.received) for node in crew.nodes.values()], crew.network.counters


@given(events)
@settings(max_examples=40)
def test_whatever_fails_the_order_of_nodes_changes_nothing(what: list[tuple[int, str, str]]) -> None:
    assert flight(what, reverse=False) == flight(what, reverse=True)


def test_to_freeze_twice_or_thaw_who_does_not_hang_is_harmless() -> None:
    crew, free = Nodes(), Nodes()
    crew.loop.thaw("a")
    crew.loop.freeze("b")
    crew.loop.freeze("b")
    crew.loop.thaw("b")
    for one in (crew, free):
        one.run(50 * TICK)
    assert [node.received for node in crew.nodes.values()] == [node.received for node in free.nodes.values()]


@pytest.mark.parametrize("action", ["freeze", "thaw", "vanish"])
def test_only_nodes_of_the_run_can_hang(action: str) -> None:
    with pytest.raises(ScheduleError, match="'x'; there are a, b, c"):
        getattr(Nodes().loop, action)("x")
