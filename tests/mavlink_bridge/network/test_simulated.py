"""Laws of the in-memory link: nothing early, nothing invented, faults as rare as said, the same again for a
seed."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.errors import BridgeError
from mavlink_bridge.network.simulated import Channel, Faults, SimulatedNetwork
from mavlink_bridge.node import Datagram

TICK = 2500
CREW = {"a": "swarm", "b": "radio", "c": "swarm"}


def numbered(number: int, link: str = "swarm") -> list[Datagram]:
    return [Datagram(link, number.to_bytes(4, "big"))]


def one_way(
    faults: Faults, count: int, seed: int = 1, spacing: int = 10_000
) -> tuple[SimulatedNetwork, list[tuple[int, int]]]:
    """Send ``count`` numbered datagrams from a to b; (time of reception, number) of what arrives."""
    network = SimulatedNetwork([Channel("air", {"a": "swarm", "b": "swarm"}, faults)], seed, TICK)
    arrived = []
    for now in range(0, count * spacing + 10_000_000, TICK):
        arrived += [(now, int.from_bytes(data, "big")) for _, data in network.receive(now, "b")]
        if now % spacing == 0 and now // spacing < count:
            network.send(now, "a", numbered(now // spacing))
    return network, arrived


def test_a_member_reaches_every_other_under_their_own_link() -> None:
    network = SimulatedNetwork([Channel("air", CREW)], 1, TICK)
    network.send(0, "a", numbered(7))
    assert [network.receive(TICK - 1, name) for name in CREW] == [[], [], []]
    assert network.receive(TICK, "a") == []
    assert network.receive(TICK, "b") == numbered(7, "radio")
    assert network.receive(TICK, "c") == numbered(7)
    assert network.receive(TICK, "c") == []
    assert network.receive(TICK, "nobody") == []


def test_channels_do_not_mix_and_links_without_channel_go_nowhere() -> None:
    wires = [Channel(f"wire-{name}", {name: "autopilot", f"pilot-{name}": "companion"}) for name in "ab"]
    network = SimulatedNetwork([*wires, Channel("air", CREW)], 1, TICK)
    network.send(0, "a", numbered(1, "autopilot") + numbered(2, "nothing"))
    assert network.receive(TICK, "pilot-a") == numbered(1, "companion")
    assert [network.receive(TICK, name) for name in ("pilot-b", "b", "c")] == [[], [], []]
    assert network.counters.unrouted == 1


def test_arrivals_are_ordered_by_time_then_sender_then_sequence() -> None:
    network = SimulatedNetwork([Channel("air", dict.fromkeys("dcba", "swarm"))], 1, TICK)
    for sender in "cab":
        network.send(0, sender, numbered(ord(sender)) + numbered(ord(sender) + 100))
    network.send(1, "a", numbered(0))
    values = [int.from_bytes(data, "big") for _, data in network.receive(10 * TICK, "d")]
    assert values == [97, 197, 98, 198, 99, 199, 0]


def test_datagrams_on_a_channel_that_is_not_counted_arrive_and_do_not_count() -> None:
    light = Channel("light", {"a": "sight", "b": "sight"}, counted=False)
    network = SimulatedNetwork([Channel("air", CREW), light], 1, TICK)
    network.send(0, "a", numbered(1, "sight") + numbered(2))
    assert sorted(network.receive(TICK, "b")) == sorted(numbered(1, "sight") + numbered(2, "radio"))
    assert network.receive(TICK, "c") == numbered(2)
    assert network.counters[:2] == (2, 2)


def any_faults(loss: st.SearchStrategy[float], burst: st.SearchStrategy[float]) -> st.SearchStrategy[Faults]:
    share, time = st.floats(0, 1), st.integers(0, 50_000)
    return st.builds(Faults, time, time, loss, share, share, burst)


SOME_FAULTS = any_faults(st.floats(0, 1), st.just(0.0)) | any_faults(st.floats(0, 0.5), st.floats(1, 20))


@given(SOME_FAULTS, st.integers(0, 2**32))
@settings(max_examples=30)
def test_nothing_is_early_and_the_books_balance(faults: Faults, seed: int) -> None:
    network = SimulatedNetwork([Channel("air", CREW, faults)], seed, TICK)
    delivered = 0
    for step in range(60):
        now = step * TICK
        for name in CREW:
            for _, data in network.receive(now, name):
                delivered += 1
                assert now - int.from_bytes(data, "big") * TICK >= max(faults.delay, TICK)
        for name, link in CREW.items():
            network.send(now, name, numbered(step, link))
        sent, got, dropped, duplicated, unrouted = network.counters
        assert sent + duplicated == got + dropped + network.under_way
        assert (sent, got, unrouted) == (3 * 2 * (step + 1), delivered, 0)


def test_loss_and_duplication_are_as_frequent_as_said() -> None:
    """Bounds of five standard deviations of the binomial."""
    count = 4000
    network, arrived = one_way(Faults(loss=0.2, duplication=0.1), count)
    assert abs(network.counters.dropped - 0.2 * count) < 5 * (count * 0.2 * 0.8) ** 0.5
    survivors = count - network.counters.dropped
    assert abs(network.counters.duplicated - 0.1 * survivors) < 5 * (survivors * 0.1 * 0.9) ** 0.5
    assert len(arrived) == survivors + network.counters.duplicated


def test_all_or_nothing() -> None:
    assert one_way(Faults(loss=1.0), 50)[1] == []
    numbers = [number for _, number in one_way(Faults(duplication=1.0), 50)[1]]
    assert numbers == [number for number in range(50) for _ in range(2)]


def test_delay_and_jitter_bound_the_time_of_arrival() -> None:
    _, arrived = one_way(Faults(delay=20_000, jitter=10_000), 2000, spacing=50_000)
    ways = [now - number * 50_000 for now, number in arrived]
    # A node looks once per tick, so that an arrival is seen up to one tick later.
    assert 20_000 <= min(ways) <= 20_000 + TICK
    assert 27_500 < max(ways) < 30_000 + TICK
    assert abs(sum(ways) / len(ways) - (25_000 + TICK / 2)) < 500


def test_reordering_lets_the_next_one_pass_whatever_the_spacing() -> None:
    count = 2000
    for spacing in (10_000, 100_000):
        _, arrived = one_way(Faults(delay=20_000, reordering=0.1), count, spacing=spacing)
        numbers = [number for _, number in arrived]
        assert sorted(numbers)[: count - 1] == list(range(count - 1))
        passed = sum(later < earlier for earlier, later in pairwise(numbers))
        assert 0.05 * count < passed < 0.15 * count


def test_a_partition_cuts_both_ways_while_it_lasts_and_only_across() -> None:
    network = SimulatedNetwork([Channel("air", CREW, Faults())], 1, TICK)
    received: dict[tuple[str, str], set[int]] = {}
    for step in range(300):
        if step == 100:
            network.cut("air", {"a"})
        if step == 200:
            network.heal("air", {"a"})
        for receiver in CREW:
            for _, data in network.receive(step * TICK, receiver):
                received.setdefault((data[:1].decode(), receiver), set()).add(int.from_bytes(data[1:], "big"))
        for sender, link in CREW.items():
            network.send(step * TICK, sender, [Datagram(link, sender.encode() + step.to_bytes(4, "big"))])
    whole, outside = set(range(299)), set(range(100)) | set(range(200, 299))
    for (sender, receiver), steps in received.items():
        assert steps == (outside if "a" in (sender, receiver) else whole)
    assert network.counters.dropped == 100 * 4


HARSH = Faults(delay=5000, jitter=9000, loss=0.2, duplication=0.1, reordering=0.2)


def story(names: list[str], seed: int, channels: list[str]) -> dict[str, list[tuple[int, str, bytes]]]:
    network = SimulatedNetwork(
        [Channel(channel, dict.fromkeys(names, channel), HARSH) for channel in channels], seed, TICK
    )
    received: dict[str, list[tuple[int, str, bytes]]] = {name: [] for name in names}
    for step in range(80):
        now = step * TICK
        for name in names:
            received[name] += [(now, *datagram) for datagram in network.receive(now, name)]
        for name in names:
            network.send(now, name, [Datagram(channel, f"{name}{step}".encode()) for channel in ("x", "y")])
    return received


@given(st.randoms(use_true_random=False))
@settings(max_examples=10)
def test_the_order_of_nodes_and_channels_makes_no_difference(shuffler: random.Random) -> None:
    names, channels = list("abcd"), ["x", "y"]
    expected = story(names, 5, channels)
    shuffler.shuffle(names)
    shuffler.shuffle(channels)
    assert story(names, 5, channels) == expected


def test_another_seed_is_another_story_and_paths_are_independent() -> None:
    names = list("abcd")
    assert story(names, 5, ["x", "y"]) != story(names, 6, ["x", "y"])
    alone = story(["a", "b"], 5, ["x", "y"])
    crowd = story(names, 5, ["x", "y"])
    assert [entry for entry in crowd["b"] if entry[2].startswith(b"a")] == alone["b"]


@pytest.mark.parametrize(
    "faults",
    [
        Faults(delay=-1),
        Faults(jitter=-4),
        Faults(loss=1.1),
        Faults(duplication=-0.1),
        Faults(loss=float("nan")),
    ],
)
def test_faults_that_make_no_sense_are_refused(faults: Faults) -> None:
    with pytest.raises(BridgeError, match="air"):
        SimulatedNetwork([Channel("air", CREW, faults)], 1, TICK)


def test_channel_names_are_unique() -> None:
    with pytest.raises(BridgeError, match="air"):
        SimulatedNetwork([Channel("air", CREW), Channel("air", CREW)], 1, TICK)
