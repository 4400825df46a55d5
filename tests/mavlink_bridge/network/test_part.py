"""Parts of a network in several processes: together they are the whole network, datagram by datagram."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.network.channel import Channel, Faults
from mavlink_bridge.network.part import NetworkPart, least_delay
from mavlink_bridge.network.simulated import NetworkCounters, SimulatedNetwork
from mavlink_bridge.node import Datagram

TICK, WINDOW, NAMES = 2500, 4, "abcde"
Received = dict[str, list[tuple[int, Datagram]]]

faults = st.builds(
    Faults,
    st.integers(WINDOW * TICK, 40_000),
    st.integers(0, 9000),
    *[st.floats(0, 1)] * 3,
    st.just(0.0),
)


def channels(air: Faults, near: Faults) -> list[Channel]:
    """One channel of all nodes, and one between two of them."""
    return [
        Channel("air", dict.fromkeys(NAMES, "swarm"), air),
        Channel("cable", dict.fromkeys("ab", "autopilot"), near),
    ]


def talk(network: SimulatedNetwork, nodes: str, step: int, received: Received) -> None:
    """Receive and send in one step; some nodes are silent in some steps."""
    now = step * TICK
    for name in nodes:
        received[name] += [(now, datagram) for datagram in network.receive(now, name)]
    for k, name in enumerate(NAMES):
        if name in nodes and step % (k + 1) == 0:
            links = ("swarm", "autopilot") if name in "ab" else ("swarm",)
            network.send(now, name, [Datagram(link, f"{name}{step}".encode()) for link in links])


@given(faults, faults, st.lists(st.sampled_from([0, 1, 2]), min_size=5, max_size=5), st.integers(0, 3))
@settings(max_examples=60, deadline=None)
def test_parts_are_together_the_whole(air: Faults, near: Faults, places: list[int], seed: int) -> None:
    """Nodes in three processes that exchange datagrams every ``WINDOW`` ticks, and cut and heal one group."""
    places[1] = places[0]
    whole = SimulatedNetwork(channels(air, near), seed, TICK)
    groups = [
        "".join(name for name, place in zip(NAMES, places, strict=True) if place == p) for p in range(3)
    ]
    parts = [NetworkPart(channels(air, near), seed, TICK, set(group)) for group in groups]
    expected: Received = {name: [] for name in NAMES}
    found: Received = {name: [] for name in NAMES}
    for step in range(120):
        talk(whole, NAMES, step, expected)
        for part, group in zip(parts, groups, strict=True):
            talk(part, group, step, found)
        if step % WINDOW == 0 or step in (50, 70, 119):
            leaving = [part.outgoing() for part in parts]
            for part in parts:
                part.admit(
                    one for sent, of in zip(leaving, parts, strict=True) if of is not part for one in sent
                )
        for network in (whole, *parts):
            if step == 50:
                network.cut("air", "ac")
            if step == 70:
                network.heal("air", "ac")
    assert found == expected
    sums = NetworkCounters(*map(sum, zip(*(part.counters for part in parts), strict=True)))
    assert sums[1:] == whole.counters[1:]
    assert sums.sent == whole.counters.sent


def test_the_least_delay_is_that_between_processes() -> None:
    near, far = Faults(delay=1000), Faults(delay=20_000)
    place = dict.fromkeys(NAMES, 1) | {"a": 0, "b": 0}
    assert least_delay(channels(far, near), TICK, place) == 20_000
    assert least_delay(channels(far, near), TICK, place | {"b": 1}) == TICK
    assert least_delay(channels(far, near), TICK, dict.fromkeys(NAMES, 0)) is None
