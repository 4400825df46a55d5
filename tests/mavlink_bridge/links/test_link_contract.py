"""What every transport promises, in both directions."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from mavlink_bridge.links.link import BURST, Link
from tests.mavlink_bridge.link_pairs import PAIRS, STREAMS, Pair, frame, frames, gather, number_of


def open_files() -> set[int]:
    found = set()
    for fileno in range(512):
        try:
            os.fstat(fileno)
        except OSError:
            continue
        found.add(fileno)
    return found


@pytest.fixture(params=[*PAIRS])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def pair(kind: str) -> Iterator[Pair]:
    before = open_files()
    pair = PAIRS[kind]()
    yield pair
    for link in pair:
        link.close()
    assert open_files() == before


def carry(pair: Pair, sent: list[bytes]) -> list[bytes]:
    for data in sent:
        pair.here.send(data)
    return gather(pair.there, lambda found: len(b"".join(found)) >= len(b"".join(sent)), [pair.here])


def test_what_is_sent_arrives_in_order_and_in_whole_frames(pair: Pair) -> None:
    for one, other in (pair, pair[::-1]):
        sent = [frame(number, number % 120) for number in range(60)]
        assert frames(carry(Pair(one, other), sent)) == sent


def test_a_datagram_of_several_frames_stays_together(pair: Pair) -> None:
    joined = b"".join(frame(number) for number in range(5))
    assert carry(pair, [joined]) == [joined]


def test_when_there_is_nothing_receive_returns_at_once(pair: Pair) -> None:
    assert pair.here.receive() == []
    assert pair.there.receive() == []


def test_all_is_counted(pair: Pair) -> None:
    here, there = pair.here.counters, pair.there.counters
    carry(pair, [frame(1), frame(2)])
    assert pair.here.counters.sent - here.sent == 2
    assert pair.here.counters.dropped == here.dropped
    assert pair.there.counters.received > there.received


def drain(link: Link, sender: Link, last: int) -> list[bytes]:
    return frames(gather(link, lambda found: bool(found) and number_of(frames(found)[-1]) == last, [sender]))


def test_a_burst_costs_whole_datagrams_at_most(kind: str, pair: Pair) -> None:
    """Nobody reads meanwhile, so that every buffer on the way fills up: sending goes on, and what then
    arrives is in order, and whole."""
    before = pair.here.counters
    sent = [frame(number, 120) for number in range(20_000)]
    for data in sent:
        pair.here.send(data)
    after = pair.here.counters
    taken = after.sent - before.sent
    assert taken + after.dropped - before.dropped == len(sent)
    found: list[bytes] = []
    while kind in STREAMS and len(found) < taken:
        found += frames(gather(pair.there, bool, [pair.here]))
    while kind not in STREAMS and (more := pair.there.receive()):
        assert len(more) <= BURST
        found += frames(more)
    numbers = [number_of(data) for data in found]
    assert numbers == sorted(set(numbers))
    assert set(found) <= set(sent)
    assert len(numbers) >= 25
    assert len(numbers) == taken or kind not in STREAMS
    # And the link is as good as before.
    pair.here.send(frame(77_777))
    assert drain(pair.there, pair.here, 77_777) == [frame(77_777)]


def test_a_peer_that_is_gone_raises_nothing(pair: Pair) -> None:
    carry(pair, [frame(1)])
    pair.there.close()
    before = pair.here.counters
    for number in range(50):
        pair.here.send(frame(number))
        assert pair.here.receive() == []
    after = pair.here.counters
    assert after.sent - before.sent + after.dropped - before.dropped == 50


def test_a_closed_end_does_nothing_any_more(pair: Pair) -> None:
    pair.there.send(frame(1))
    gather(pair.here, bool)
    pair.there.send(frame(2))
    pair.here.close()
    pair.here.close()
    sent = pair.here.counters.sent
    pair.here.send(frame(3))
    assert pair.here.counters.sent == sent
    assert pair.here.receive() == []
    assert pair.there.receive() == []


def test_what_can_be_waited_for_is_ready_when_there_is_something(kind: str, pair: Pair) -> None:
    fileno = pair.there.fileno()
    assert (fileno is None) == (kind == "memory")
    carry(pair, [frame(1)])
    assert pair.there.fileno() == fileno
