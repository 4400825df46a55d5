"""Laws of what the in-memory link does to one direction, of cuts made while running, of bursts and of
buffers: only what is named is touched."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.errors import BridgeError
from mavlink_bridge.network.channel import Direction
from mavlink_bridge.network.simulated import Channel, Faults, NetworkCounters, SimulatedNetwork
from mavlink_bridge.node import Datagram

TICK = 2500
NAMES = "abcd"
HARSH = Faults(delay=5000, jitter=9000, loss=0.2, duplication=0.1, reordering=0.2)
DEAF = Faults(loss=1.0)
NOTHING: Mapping[Direction, Faults] = {}

Heard = dict[tuple[str, str], list[tuple[int, bytes]]]
"""(sender, receiver) → (time of reception, data)."""


def channel(
    faults: Faults = HARSH,
    overrides: Mapping[Direction, Faults] = NOTHING,
    order: str = NAMES,
) -> Channel:
    return Channel("air", dict.fromkeys(order, "swarm"), faults, overrides)


def story(
    of: Channel,
    steps: int = 100,
    meddle: Callable[[int, SimulatedNetwork], None] = lambda _step, _network: None,
) -> tuple[Heard, NetworkCounters]:
    """Everyone talks in every step; ``meddle`` then does what it likes. The books balance all the time."""
    network = SimulatedNetwork([of], 5, TICK)
    received: Heard = {(a, b): [] for a in NAMES for b in NAMES if a != b}
    for step in range(steps):
        now = step * TICK
        for receiver in of.members:
            for _, data in network.receive(now, receiver):
                received[data[:1].decode(), receiver].append((now, data))
        for sender in of.members:
            network.send(now, sender, [Datagram("swarm", f"{sender}{step}".encode())])
        meddle(step, network)
        sent, delivered, dropped, duplicated, _ = network.counters
        assert sent + duplicated == delivered + dropped + network.under_way
    return received, network.counters


# Directions


def test_the_most_specific_override_wins() -> None:
    overrides: dict[Direction, Faults] = {
        ("a", "b"): Faults(1),
        ("a", None): Faults(2),
        (None, "b"): Faults(3),
        (None, None): Faults(4),
    }
    of = channel(overrides=overrides)
    ways = {(s, r): of.between(s, r).delay for s, r in ("ab", "ac", "cb", "cd")}
    assert ways == {("a", "b"): 1, ("a", "c"): 2, ("c", "b"): 3, ("c", "d"): 4}
    assert channel().between("c", "d") == HARSH


delays, shares = st.integers(0, 9000), st.floats(0, 1)


@given(
    st.tuples(st.none() | st.sampled_from(NAMES), st.none() | st.sampled_from(NAMES)).filter(any),
    st.builds(Faults, delays, delays, shares, shares, shares, st.just(0.0)),
)
@settings(max_examples=30)
def test_an_override_touches_only_its_direction(direction: Direction, faults: Faults) -> None:
    """Not a draw of any other path changes."""
    before, _ = story(channel())
    after, _ = story(channel(overrides={direction: faults}))
    sender, receiver = direction
    for path in before:
        if sender not in (None, path[0]) or receiver not in (None, path[1]):
            assert after[path] == before[path]


def test_an_override_is_what_the_channel_would_do_itself() -> None:
    """Faults given for every direction are faults given for the channel."""
    calm = Faults(delay=20_000)
    assert story(channel(calm, {(None, None): HARSH})) == story(channel())
    assert story(channel(calm, {(name, None): HARSH for name in NAMES})) == story(channel())
    assert story(channel(calm, {(None, name): HARSH for name in NAMES})) == story(channel())


def test_a_direction_may_be_dead_while_the_way_back_is_clean() -> None:
    received, counters = story(channel(Faults(), {("a", "b"): DEAF}))
    assert received["a", "b"] == []
    assert {len(all_heard) for path, all_heard in received.items() if path != ("a", "b")} == {99}
    assert counters.dropped == 100


@pytest.mark.parametrize(
    ("overrides", "naming"),
    [
        ({("a", "x"): Faults()}, r"'air', from a to x: 'x' is not a member; a, b, c, d are"),
        ({("x", None): Faults()}, r"from x to any"),
        ({("a", "b"): Faults(loss=2)}, r"from a to b: loss = 2"),
        ({(None, None): Faults(delay=-4)}, r"from any to any: delay = -4"),
    ],
)
def test_overrides_that_make_no_sense_are_refused(overrides: dict[Direction, Faults], naming: str) -> None:
    with pytest.raises(BridgeError, match=naming):
        SimulatedNetwork([channel(overrides=overrides)], 1, TICK)


# Cuts


@given(st.integers(0, 60), st.integers(0, 40), st.sets(st.sampled_from(NAMES)))
@settings(max_examples=30)
def test_a_cut_with_an_end_is_as_one_that_is_healed_then(begin: int, length: int, members: set[str]) -> None:
    """Made after step k − 1, until step k + n or healed after step k + n − 1: the same bytes."""
    end = (begin + 1 + length) * TICK

    def bounded(step: int, network: SimulatedNetwork) -> None:
        if step == begin:
            network.cut("air", members, end)

    def healed(step: int, network: SimulatedNetwork) -> None:
        if step == begin:
            network.cut(None, members)
        if step == begin + length:
            network.heal()

    assert story(channel(), meddle=bounded) == story(channel(), meddle=healed)


def test_cuts_add_up_and_each_is_healed_by_its_own_name() -> None:
    def meddle(step: int, network: SimulatedNetwork) -> None:
        if step == 9:
            network.cut(None, "a")
            network.cut("air", "ab", 60 * TICK)
        if step == 39:
            network.heal("air", "a")
            network.heal(None, "c")
        if step == 79:
            network.heal(None, "a")

    received, _ = story(channel(Faults()), 120, meddle)
    sent = {path: {int(data[1:]) for _, data in all_heard} for path, all_heard in received.items()}
    alone, pair = set(range(10, 80)), set(range(10, 60))
    for path, arrived in sent.items():
        lost = set(range(119)) - arrived
        assert lost == (alone if "a" in path else set()) | (pair if len({*path} & {*"ab"}) == 1 else set())


def test_a_cut_of_one_channel_leaves_the_others() -> None:
    network = SimulatedNetwork([Channel(name, dict.fromkeys("ab", name)) for name in ("x", "y")], 1, TICK)
    network.cut("x", "a")
    network.send(0, "a", [Datagram("x", b"1"), Datagram("y", b"2")])
    network.send(0, "b", [Datagram("x", b"3"), Datagram("y", b"4")])
    assert network.receive(TICK, "b") == [Datagram("y", b"2")]
    assert network.receive(TICK, "a") == [Datagram("y", b"4")]


def test_cuts_of_what_is_not_there_are_refused() -> None:
    network = SimulatedNetwork([channel()], 1, TICK)
    with pytest.raises(BridgeError, match="'fog'; there are air"):
        network.cut("fog", "a")
    with pytest.raises(BridgeError, match="'x'; there are a, b, c, d"):
        network.cut(None, "ax")


@given(st.permutations(NAMES))
@settings(max_examples=10)
def test_the_order_of_members_makes_no_difference(order: list[str]) -> None:
    overrides: dict[Direction, Faults] = {("a", None): HARSH._replace(loss=0.5, burst=4.0), (None, "c"): DEAF}

    def meddle(step: int, network: SimulatedNetwork) -> None:
        if step == 20:
            network.cut("air", "d", 50 * TICK)

    expected = story(channel(overrides=overrides), meddle=meddle)
    assert story(channel(overrides=overrides, order="".join(order)), meddle=meddle) == expected


# Bursts


def losses(faults: Faults, count: int) -> list[bool]:
    """Of so many datagrams on one path, which were lost."""
    network = SimulatedNetwork([Channel("air", {"a": "swarm", "b": "swarm"}, faults)], 3, TICK)
    for number in range(count):
        network.send(number * TICK, "a", [Datagram("swarm", number.to_bytes(4, "big"))])
    arrived = {int.from_bytes(data, "big") for _, data in network.receive((count + 1) * TICK, "b")}
    return [number not in arrived for number in range(count)]


@pytest.mark.parametrize(("share", "burst"), [(0.2, 5.0), (0.05, 20.0), (0.5, 1.0), (0.3, 0.0)])
def test_bursts_have_their_length_and_losses_their_share(share: float, burst: float) -> None:
    """Within five standard deviations; independent losses have bursts of 1 / (1 − loss)."""
    count = 60_000
    lost = losses(Faults(loss=share, burst=burst), count)
    bursts = sum(now and not before for before, now in zip([False, *lost], lost, strict=False))
    mean = burst or 1 / (1 - share)
    # The length of a burst is geometric: its variance is mean² − mean. So long a chain has count / (bursts
    # and gaps) independent pieces.
    assert abs(sum(lost) / bursts - mean) <= 5 * ((mean**2 - mean) / bursts) ** 0.5 + 1e-9
    spread = (share * (1 - share) * 2 * mean / count) ** 0.5
    assert abs(sum(lost) / count - share) < 5 * spread


def test_bursts_at_the_ends() -> None:
    assert all(losses(Faults(loss=1.0, burst=3.0), 50))
    assert not any(losses(Faults(loss=0.0, burst=3.0), 50))


@pytest.mark.parametrize(("loss", "burst"), [(0.1, 0.5), (0.1, -1.0), (0.8, 3.9), (0.1, float("nan"))])
def test_bursts_that_cannot_be_are_refused(loss: float, burst: float) -> None:
    with pytest.raises(BridgeError, match="burst"):
        SimulatedNetwork([channel(Faults(loss=loss, burst=burst))], 1, TICK)


# Buffers


@given(st.integers(0, 12), st.lists(st.integers(0, 30), min_size=1, max_size=5))
def test_a_buffer_keeps_the_oldest_however_often_it_is_filled(room: int, looks: list[int]) -> None:
    network = SimulatedNetwork([Channel("air", {"a": "swarm", "b": "swarm"})], 1, TICK)
    for number in range(20):
        network.send(number * TICK, "a", [Datagram("swarm", bytes([number]))])
    for look in sorted(looks):
        network.keep(look * TICK, "b", room)
    arrived = [data[0] for _, data in network.receive(30 * TICK, "b")]
    assert arrived == list(range(20))[:room]
    assert network.counters == (20, len(arrived), 20 - len(arrived), 0, 0)
    network.send(30 * TICK, "a", [Datagram("swarm", b"x")] * 20)
    assert len(network.receive(31 * TICK, "b")) == 20
    assert network.under_way == 0


def test_a_run_with_everything_is_the_same_again() -> None:
    def meddle(step: int, network: SimulatedNetwork) -> None:
        chance = random.Random(step)
        if chance.random() < 0.2:
            network.cut(None, chance.sample(NAMES, 2), (step + chance.randrange(20)) * TICK)
        if chance.random() < 0.2:
            network.keep(step * TICK, chance.choice(NAMES), chance.randrange(4))
        if chance.random() < 0.05:
            network.heal()

    first = story(channel(overrides={("a", None): HARSH._replace(loss=0.4, burst=3.0)}), 300, meddle)
    assert first == story(channel(overrides={("a", None): HARSH._replace(loss=0.4, burst=3.0)}), 300, meddle)
    assert first[1].dropped > 300
