"""What waits for a node: bounded, in order, and a flood on one link is no matter of the others."""

from __future__ import annotations

import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.links.endpoints import TcpIn
from mavlink_bridge.links.link import memory_pair
from mavlink_bridge.links.tcp import TcpListener
from mavlink_bridge.loops.inbox import CAPACITY, MAX_STEP_BYTES, MAX_STEP_DATAGRAMS, ROOM, Inbox
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.framing import LONGEST_FRAME
from tests.mavlink_bridge.link_pairs import HOST, frame, frames

sizes = st.integers(1, 3000) | st.sampled_from(
    [MAX_STEP_BYTES - 1, MAX_STEP_BYTES, MAX_STEP_BYTES + 1, 65507]
)
many = st.integers(0, 3 * MAX_STEP_DATAGRAMS).map(lambda count: [20] * count)


@given(st.lists(sizes, max_size=60) | many, st.lists(sizes, max_size=60) | many)
def test_all_comes_in_its_order_a_handful_of_each_link_at_a_time(one: list[int], other: list[int]) -> None:
    (near, far), (near_too, far_too) = memory_pair(), memory_pair()
    inbox = Inbox([("one", near), ("other", near_too)])
    sent = {"one": [bytes([k % 256]) * size for k, size in enumerate(one)]}
    sent["other"] = [bytes([k % 256]) * size for k, size in enumerate(other)]
    for link, data in ((far, sent["one"]), (far_too, sent["other"])):
        for piece in data:
            link.send(piece)
    found: dict[str, list[bytes]] = {"one": [], "other": []}
    while any(len(found[name]) < len(sent[name]) for name in sent):
        taken = inbox.take()
        for name in sent:
            part = [data for link, data in taken if link == name]
            left = sent[name][len(found[name]) :]
            assert part == left[: len(part)]
            # As much as fits into a handful, and one at least.
            assert len(part) <= 1 or (
                sum(map(len, part)) <= MAX_STEP_BYTES and len(part) <= MAX_STEP_DATAGRAMS
            )
            if len(part) < min(len(left), MAX_STEP_DATAGRAMS):
                assert sum(map(len, part)) + len(left[len(part)]) > MAX_STEP_BYTES
            assert part or not left
            found[name] += part
    assert inbox.take() == []
    assert inbox.overruns == 0


def test_a_flood_on_one_link_costs_the_others_nothing() -> None:
    (near, far), (near_too, far_too) = memory_pair(), memory_pair()
    inbox = Inbox([("flooded", near), ("quiet", near_too)])
    for number in range(300):
        for _ in range(200):
            far.send(bytes(1000))
        far_too.send(bytes([number % 256]))
        taken = inbox.take()
        assert taken[-1] == Datagram("quiet", bytes([number % 256]))
        assert len(taken) == MAX_STEP_BYTES // 1000 + 1
    queue = inbox._queues[0]
    assert queue._bytes <= ROOM
    assert inbox.overruns > 0


@pytest.mark.parametrize(("size", "most"), [(10, CAPACITY), (1400, ROOM // 1400)])
def test_of_too_much_the_newest_stay(size: int, most: int) -> None:
    near, far = memory_pair()
    inbox = Inbox([("link", near)])
    count = 3 * CAPACITY
    for number in range(count):
        far.send(number.to_bytes(4, "big").ljust(size, b"\0"))
        if number % 500 == 0:
            inbox._read()
    found: list[bytes] = []
    while taken := inbox.take():
        found += [data for _, data in taken]
    assert [int.from_bytes(data[:4], "big") for data in found] == [*range(count - most, count)]
    assert inbox.overruns == count - most


def test_who_says_too_much_over_tcp_has_to_wait_and_loses_nothing() -> None:
    listener = TcpListener(TcpIn(HOST, 0), SimulatedClock())
    inbox = Inbox([("link", listener)])
    sent, found, stream = 0, [], b""
    with socket.create_connection(listener.address) as caller:
        caller.setblocking(False)
        refused = 0
        while refused < 20:
            stream = stream or b"".join(frame(sent + k, 120) for k in range(100))
            try:
                done = caller.send(stream)
                refused, stream = 0, stream[done:]
                sent += 0 if stream else 100
            except BlockingIOError:
                refused += 1
                with inbox._reading:
                    inbox._read()
            assert inbox._queues[0]._bytes < MAX_STEP_BYTES + 8192 + LONGEST_FRAME
        caller.setblocking(True)
        while len(found) < sent:
            found += frames([data for _, data in inbox.take()])
    assert found[:sent] == [frame(k, 120) for k in range(sent)]
    assert inbox.overruns == 0
    assert sent * len(frame(0, 120)) > 10 * MAX_STEP_BYTES
    inbox.close()
    listener.close()
