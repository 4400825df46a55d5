"""Nothing that a client sends over TCP is dropped, however much of it arrives at once."""

from __future__ import annotations

import socket
import struct
from contextlib import suppress

import pytest

from mavlink_bridge import messages as m
from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.links.endpoints import TcpIn
from mavlink_bridge.links.stream import Stream
from mavlink_bridge.links.streams import MOST_FRAMES
from mavlink_bridge.links.tcp import TcpListener
from mavlink_bridge.messages import CommandAck, CommandLong, Message, ParamSet, ParamValue, Ping, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from tests.sitl.autopilot_rig import FLAVOURS, LINK, Rig

ME = Source(255, 190)


class Server:
    """An emulated autopilot behind a listening socket, and a client; time passes step by step."""

    def __init__(self, flavour: str) -> None:
        self.rig = Rig(flavour, streams="normal", start_height=5.0)
        self.clock = SimulatedClock(0)
        self.link = TcpListener(TcpIn("127.0.0.1", 0), self.clock)
        self.client = socket.create_connection(self.link.address[:2])
        self.client.setblocking(False)
        self._codec = Codec()

    def close(self) -> None:
        self.client.close()
        self.link.close()

    def step(self, *, reads: bool = True) -> list[Message]:
        """One step of the vehicle; what the client has received by then, if it ``reads``."""
        arrived = [Datagram(LINK, data) for data in self.link.receive()]
        for datagram in self.rig.autopilot.step(self.rig.now, arrived):
            self.link.send(datagram.data)
        self.rig.now += 10_000
        found: list[Message] = []
        while reads:
            try:
                found += self._codec.feed(self.client.recv(65536))
            except BlockingIOError:
                break
        return found


@pytest.fixture(params=FLAVOURS)
def server(request):
    made = Server(request.param)
    yield made
    made.close()


def send(server: Server, data: bytes, patience: int = 500) -> list[Message]:
    """All of ``data``, as fast as it is taken, and what is answered until ``patience`` steps are quiet."""
    found: list[Message] = []
    idle = 0
    # After a full window the system waits for hundreds of milliseconds before it sends on.
    while idle < patience:
        with suppress(BlockingIOError):
            data = data[server.client.send(data) :] if data else data
        new = [message for message in server.step() if not isinstance(message, m.Heartbeat)]
        found += new
        idle = 0 if data else idle + 1
    return found


def test_each_of_two_thousand_requests_is_answered(server: Server) -> None:
    codec = Codec()
    requests = b"".join(codec.encode(Ping(ME, k, k % 256, 0, 0)) for k in range(2000))
    answers = [message.time for message in send(server, requests) if isinstance(message, Ping)]
    assert answers == list(range(2000))


def test_each_of_many_commands_is_acknowledged(server: Server) -> None:
    codec = Codec()
    orders = b"".join(codec.encode(CommandLong(ME, 11, 1, 31_000 + k, 0, (0.0,) * 7)) for k in range(500))
    acks = [message.command for message in send(server, orders) if isinstance(message, CommandAck)]
    assert acks == [31_000 + k for k in range(500)]


def test_each_of_sixty_parameters_takes_effect(server: Server) -> None:
    codec = Codec()
    name = {"ardupilot": "GUID_TIMEOUT", "px4": "COM_OF_LOSS_T"}[server.rig.autopilot.config.flavour]
    wanted = [0.5 + 0.01 * k for k in range(60)]
    sets = [ParamSet(ME, struct.pack("<f", value), 11, 1, name, 9) for value in wanted]
    answers = send(server, b"".join(map(codec.encode, sets)))
    said = [struct.unpack("<f", a.raw)[0] for a in answers if isinstance(a, ParamValue)]
    assert said == pytest.approx(wanted)


@pytest.mark.slow
def test_a_client_that_does_not_read_is_not_read_from_and_loses_nothing(server: Server) -> None:
    """Its requests wait in the system, and all are answered when it reads again."""
    codec = Codec()
    count, sent = 30_000, 0
    data = b"".join(codec.encode(Ping(ME, k, k % 256, 0, 0)) for k in range(count))
    for _ in range(1000):
        with suppress(BlockingIOError):
            sent += server.client.send(data[sent : sent + 65536])
        server.step(reads=False)
    assert MOST_FRAMES * server.link.counters.received < count
    answers = [message.time for message in send(server, data[sent:], 20_000) if isinstance(message, Ping)]
    assert answers == list(range(count))


def test_orders_of_a_client_that_stays_backed_up_get_through(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It reads all the time, but never as much as waits for it."""
    monkeypatch.setattr(Stream, "backed_up", property(lambda _stream: True))
    order = Codec().encode(CommandLong(ME, 11, 1, 21, 0, (0.0,) * 7))
    read: list[bytes] = []
    server.link.receive()
    server.client.send(order)
    for turn in range(5000):
        server.clock.wait_until(1_000 * turn)
        server.link.send(bytes(4096))
        with suppress(BlockingIOError):
            server.client.recv(3000)
        read += server.link.receive()
    assert read == [order]


def test_what_is_read_at_once_comes_in_pieces_that_join_to_it(server: Server) -> None:
    codec = Codec()
    data = b"".join(codec.encode(Ping(ME, k, 0, 0, 0)) for k in range(200)) + b"garbage"
    server.client.send(data)
    pieces: list[bytes] = []
    for _ in range(1000):
        pieces += server.link.receive()
        if sum(map(len, pieces)) >= len(data):
            break
    assert b"".join(pieces) == data
    assert max(len(Codec().feed(piece)) for piece in pieces) <= MOST_FRAMES
