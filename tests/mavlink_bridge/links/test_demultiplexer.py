"""Several ends of one physical link: all that came before is forgotten, and nothing that comes after."""

from __future__ import annotations

import socket

import pytest

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.links.demultiplexer import Demultiplexer
from mavlink_bridge.links.endpoints import TcpIn
from mavlink_bridge.links.link import BURST, memory_pair
from mavlink_bridge.links.tcp import TcpListener
from mavlink_bridge.wire.header import Header
from tests.mavlink_bridge.link_pairs import HOST, frame, frames, gather


class Listening:
    """An observer that counts."""

    heard_frames = 0

    def said(self, data: bytes) -> None:
        """Nothing is."""

    def received(self, _header: Header, _frame: bytes) -> None:
        self.heard_frames += 1


@pytest.mark.parametrize("read", [False, True], ids=["nobody has read yet", "some has been dealt out"])
def test_all_that_waits_is_forgotten(read: bool) -> None:
    """More than one read brings."""
    own, far = memory_pair()
    ear = Listening()
    demultiplexer = Demultiplexer(own, {"one": lambda _header: True, "other": lambda _header: True}, ear)
    for k in range(3 * BURST):
        far.send(frame(k))
    if read:
        demultiplexer.ends["one"].receive()
    received = ear.heard_frames
    demultiplexer.forget()
    assert ear.heard_frames == received
    far.send(frame(7))
    assert {name: end.receive() for name, end in demultiplexer.ends.items()} == {
        "one": [frame(7)],
        "other": [frame(7)],
    }


def test_who_has_called_and_spoken_before_anybody_read_is_forgotten_too() -> None:
    """Calls are answered one at a time, and long ago said is said long ago by whomever."""
    listener = TcpListener(TcpIn(HOST, 0), SimulatedClock())
    demultiplexer = Demultiplexer(listener, {"only": lambda _header: True})
    callers = [socket.create_connection(listener.address[:2]) for _ in range(3)]
    for caller in callers:
        caller.sendall(b"".join(frame(k) for k in range(600)))
    demultiplexer.forget()
    for number, caller in enumerate(callers):
        caller.sendall(frame(1000 + number))
    end = demultiplexer.ends["only"]
    found = gather(end, lambda found: len(frames(found)) >= len(callers))
    assert sorted(frames(found)) == [frame(1000 + k) for k in range(len(callers))]
    for caller in callers:
        caller.close()
    end.close()
