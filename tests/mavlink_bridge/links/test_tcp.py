"""What is peculiar to TCP: streams of frames, callers that come, go and do not read."""

from __future__ import annotations

import socket
from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.links.endpoints import TcpIn, TcpOut
from mavlink_bridge.links.stream import Assembler
from mavlink_bridge.links.streams import HUNG, RETRY
from mavlink_bridge.links.tcp import BACKLOG, MOST_CALLERS, TcpCaller, TcpListener
from mavlink_bridge.messages import Message
from mavlink_bridge.wire.codec import Codec
from tests.mavlink_bridge.link_pairs import HOST, frame, frames, free_port, gather, meet, tcp, wait


@given(
    st.lists(
        st.one_of(
            st.integers(0, 2**32 - 1).map(lambda number: frame(number, number % 100)),
            st.binary(max_size=40),
            st.just(b"\xfd\x03\0\0\x01\x0b\x01\xef\xbe\xad" + b"abc" + b"\x12\x34"),  # an unknown message
        ),
        max_size=12,
    ),
    st.lists(st.integers(1, 300), min_size=1, max_size=20),
)
@settings(max_examples=200)
def test_a_stream_put_together_loses_nothing(parts: list[bytes], cuts: list[int]) -> None:
    stream = b"".join(parts)
    assembler, after, plain = Assembler(), Codec(), Codec()
    said: list[Message] = []
    expected: list[Message] = []
    out = b""
    at = turn = 0
    while at < len(stream):
        size = cuts[turn % len(cuts)]
        piece = assembler.feed(stream[at : at + size])
        said += after.feed(piece)
        expected += plain.feed(stream[at : at + size])
        assert said == expected[: len(said)]
        out += piece
        at, turn = at + size, turn + 1
    assert out == stream[: len(out)]
    assert len(stream) - len(out) < 281
    assert said + after.feed(stream[len(out) :]) == expected
    assert after.counters == plain.counters


@given(st.lists(st.integers(0, 120), max_size=20), st.lists(st.integers(1, 300), min_size=1, max_size=20))
def test_a_stream_of_frames_is_cut_between_frames(sizes: list[int], cuts: list[int]) -> None:
    sent = [frame(number, size) for number, size in enumerate(sizes)]
    stream, assembler = b"".join(sent), Assembler()
    ends = [sum(cuts[k % len(cuts)] for k in range(turn)) for turn in range(len(stream) + 1)]
    pieces = [assembler.feed(stream[start:end]) for start, end in pairwise(ends)]
    assert frames(pieces) == sent


def test_a_caller_waits_for_a_listener_and_finds_it_again() -> None:
    clock = SimulatedClock()
    port = free_port()
    caller = TcpCaller(TcpOut(HOST, port), clock)
    caller.send(frame(1))
    assert caller.counters.dropped == 1
    for turn in range(3):
        listener = TcpListener(TcpIn(HOST, port), clock)
        clock.wait_until(clock.now() + RETRY)
        caller.receive()
        # The call from before the listener was there may have to be given up first.
        while not caller.peers:
            wait(caller)
            caller.receive()
            clock.wait_until(clock.now() + RETRY)
        meet(caller, listener)
        caller.send(frame(turn))
        assert gather(listener, bool) == [frame(turn)]
        listener.close()
        while caller.peers:
            wait(caller)
            assert caller.receive() == []
    caller.close()


def test_a_sender_notices_by_itself_that_there_is_room_again() -> None:
    here, there = tcp()
    while not here.counters.dropped:
        here.send(frame(1, 120))
    sent = here.counters.sent
    found = 0
    while found < sent - 1000:
        wait(there)
        found += len(frames(there.receive()))
    here.send(frame(2, 120))
    assert here.counters.sent == sent + 1
    here.close()
    there.close()


def test_everyone_who_has_called_hears_everything() -> None:
    clock = SimulatedClock()
    listener = TcpListener(TcpIn(HOST, 0), clock)
    callers = [TcpCaller(TcpOut(HOST, listener.address[1]), clock) for _ in range(3)]
    while listener.peers < 3 or not all(caller.peers for caller in callers):
        wait(listener, *callers)
        for link in (listener, *callers):
            link.receive()
    listener.send(frame(1))
    assert all(gather(caller, bool) == [frame(1)] for caller in callers)
    callers[0].close()
    while listener.peers == 3:
        wait(listener)
        assert listener.receive() == []
    listener.send(frame(2))
    assert all(gather(caller, bool) == [frame(2)] for caller in callers[1:])
    for link in (listener, *callers):
        link.close()


def test_who_calls_and_never_reads_costs_nobody_else_anything_and_is_given_up() -> None:
    clock = SimulatedClock()
    listener = TcpListener(TcpIn(HOST, 0), clock)
    sleeper = socket.create_connection(listener.address)
    reader = TcpCaller(TcpOut(HOST, listener.address[1]), clock)
    meet(reader, listener)
    while listener.peers < 2:
        wait(listener)
        listener.receive()
    number = received = 0
    while listener.peers == 2:
        # Some seconds of a busy vehicle from one second to the next.
        clock.wait_until(clock.now() + 1_000_000)
        for _ in range(20):
            listener.send(frame(number, 120) * 8)
            number += 1
            received += len(frames(gather(reader, bool)))
        assert all(len(stream._waiting) <= BACKLOG for stream in listener._streams)
    assert clock.now() > HUNG
    assert listener.counters.dropped == 0
    while received < 8 * number:
        received += len(frames(gather(reader, bool)))
    assert received == 8 * number
    for one in (sleeper, reader, listener):
        one.close()


def test_who_takes_a_little_now_and_then_is_not_given_up() -> None:
    clock = SimulatedClock()
    listener = TcpListener(TcpIn(HOST, 0), clock)
    slow = socket.create_connection(listener.address)
    while not listener.peers:
        wait(listener)
        listener.receive()
    while not listener.counters.dropped:
        listener.send(frame(1, 120) * 8)
    for _ in range(5):
        clock.wait_until(clock.now() + HUNG - 1)
        sent = listener.counters.sent
        while listener.counters.sent == sent:
            slow.recv(1 << 16)
            listener.send(frame(2, 120))
        while listener.counters.sent > sent:
            sent = listener.counters.sent
            listener.send(frame(3, 120))
        assert listener.peers == 1
    slow.close()
    listener.close()


def test_callers_that_vanish_leave_room_for_others() -> None:
    """More than there are places for, one after the other and many at once."""
    listener = TcpListener(TcpIn(HOST, 0), SimulatedClock())
    for _ in range(3):
        crowd = [socket.create_connection(listener.address) for _ in range(MOST_CALLERS + 5)]
        while listener.peers < MOST_CALLERS:
            wait(listener)
            listener.receive()
        for caller in crowd:
            caller.send(frame(1)[:-3])
            caller.close()
        while listener.peers:
            listener.send(frame(2))
            listener.receive()
    assert len(listener._selector.get_map()) == 1
    listener.close()


def test_frames_of_two_callers_are_not_mixed_however_they_are_cut() -> None:
    clock = SimulatedClock()
    listener = TcpListener(TcpIn(HOST, 0), clock)
    with socket.create_connection(listener.address) as one, socket.create_connection(listener.address) as two:
        found: list[bytes] = []
        whole = [frame(1, 90), frame(2, 90)]
        for start in range(0, len(whole[0]), 10):
            for caller, data in zip((one, two), whole, strict=True):
                caller.sendall(data[start : start + 10])
            wait(listener)
            found += listener.receive()
        found += gather(listener, lambda more: len(found) + len(more) == 2)
    assert sorted(frames(found)) == sorted(whole)
    listener.close()
