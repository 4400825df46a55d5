"""Radio range of a channel: who hears whom depends on the places at the time of sending alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.errors import BridgeError
from mavlink_bridge.network.channel import Channel, Faults
from mavlink_bridge.network.radio_range import RadioRange
from mavlink_bridge.network.simulated import SimulatedNetwork
from mavlink_bridge.node import Datagram

NAMES, TICK = "abcd", 2500
Track = list[tuple[float, float, float]]
coordinates = st.floats(-20.0, 20.0)
places = st.lists(st.tuples(*[coordinates] * 3), min_size=4, max_size=4)


def network(most: float, where: dict[int, Track], faults: Faults) -> SimulatedNetwork:
    """All nodes on a channel with a range, at the places ``where`` by time; ``a`` and ``b`` on a cable."""
    air = Channel("air", dict.fromkeys(NAMES, "swarm"), faults)
    cable = Channel("cable", dict.fromkeys("ab", "cable"))
    found = SimulatedNetwork([air, cable], 1, TICK)
    found.limit("air", RadioRange(most, NAMES, lambda now: np.array(where[now])))
    return found


def said(sender: str, now: int, link: str = "swarm") -> Datagram:
    return Datagram(link, f"{sender}{now}".encode())


@given(st.lists(places, min_size=3, max_size=3), st.floats(0.5, 30.0))
@settings(max_examples=60, deadline=None)
def test_a_message_arrives_exactly_within_range(tracks: list[Track], most: float) -> None:
    """Also when the two are elsewhere at the time of arrival; both ways alike."""
    where = {step * TICK: there for step, there in enumerate(tracks)}
    air = network(most, where, Faults(delay=5 * TICK))
    for now in where:
        for sender in NAMES:
            air.send(now, sender, [said(sender, now)])
    heard = {name: {one.data for one in air.receive(100 * TICK, name)} for name in NAMES}
    for now, there in where.items():
        for i, one in enumerate(NAMES):
            for j, other in enumerate(NAMES):
                apart = np.subtract(there[i], there[j])
                within = i != j and float(np.einsum("i,i->", apart, apart)) <= most * most
                assert (said(one, now).data in heard[other]) == within
    counts = air.counters
    assert counts.sent == counts.delivered + counts.dropped + air.under_way


def test_the_edge_belongs_to_the_range() -> None:
    there = [(0.0, 0.0, 0.0), (3.0, 4.0, 0.0), (0.0, 0.0, 5.000001), (0.0, -5.0, 0.0)]
    air = network(5.0, {0: there}, Faults())
    air.send(0, "a", [said("a", 0)])
    assert [bool(air.receive(TICK, name)) for name in NAMES] == [False, True, False, True]


def test_other_channels_have_no_range() -> None:
    far = [(0.0, 0.0, 0.0), (100.0, 0.0, 0.0), (0.0, 100.0, 0.0), (0.0, 0.0, 100.0)]
    air = network(5.0, {0: far}, Faults())
    air.send(0, "a", [said("a", 0, "cable")])
    assert air.receive(TICK, "b") == [said("a", 0, "cable")]


@given(places, st.integers(0, 9))
@settings(max_examples=30, deadline=None)
def test_a_range_changes_no_draw_of_the_paths_within_it(there: Track, seed: int) -> None:
    """What arrives within range is what arrives without one, with random faults."""
    faults = Faults(delay=9000, jitter=9000, loss=0.3, duplication=0.3, reordering=0.3)
    limited = network(10.0, dict.fromkeys(range(0, 60 * TICK, TICK), there), faults)
    free = SimulatedNetwork([Channel("air", dict.fromkeys(NAMES, "swarm"), faults)], 1, TICK)
    for now in range(0, 60 * TICK, TICK):
        for name in NAMES:
            limited.send(now, name, [said(name, now)])
            free.send(now, name, [said(name, now)])
    apart = np.subtract(there[0], there[1])
    within = float(np.einsum("i,i->", apart, apart)) <= 100.0
    from_a = [[one for one in net.receive(10**9, "b") if one.data[:1] == b"a"] for net in (limited, free)]
    assert from_a[0] == (from_a[1] if within else [])


def test_an_unknown_channel_is_refused() -> None:
    with pytest.raises(BridgeError, match="no channel is named 'sea'; there are air"):
        network(1.0, {}, Faults()).limit("sea", RadioRange(1.0, NAMES, lambda _now: np.empty((0, 3))))
