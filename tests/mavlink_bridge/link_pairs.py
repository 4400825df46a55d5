"""Two ends of every transport, on this machine only, and how to wait for them without a clock."""

from __future__ import annotations

import os
import select
import tty
from collections.abc import Callable, Sequence
from typing import NamedTuple

from mavlink_bridge.clocks.clock import Clock, SimulatedClock
from mavlink_bridge.links.endpoints import Multicast, Serial, TcpIn, TcpOut, UdpIn, UdpOut
from mavlink_bridge.links.link import Link, memory_pair
from mavlink_bridge.links.serial_port import SerialPort
from mavlink_bridge.links.streams import StreamLink
from mavlink_bridge.links.tcp import TcpCaller, TcpListener
from mavlink_bridge.links.udp import MulticastLink, UdpCaller, UdpListener
from mavlink_bridge.messages import Source, Tunnel
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Framer

HOST = "127.0.0.1"
PATIENCE = 30.0
"""s until a test gives up; what is waited for comes within milliseconds."""


class Pair(NamedTuple):
    """``here`` has been heard by ``there``, and the other way round."""

    here: Link
    there: Link


class Terminal(StreamLink):
    """The far end of a pseudo-terminal: what the vehicle would be."""

    def __init__(self, fileno: int, clock: Clock) -> None:
        super().__init__(clock, 65536)
        self._adopt(fileno)


def wait(*links: Link) -> None:
    """Until one of ``links`` has something to do."""
    ready, _, _ = select.select([link.fileno() for link in links], [], [], PATIENCE)
    assert ready, "nothing came"


def gather(link: Link, enough: Callable[[list[bytes]], bool], others: Sequence[Link] = ()) -> list[bytes]:
    """What ``link`` receives until it is ``enough``; ``others`` are given time to finish their writing."""
    found = link.receive()
    while not enough(found):
        if link.fileno() is not None:
            wait(link, *others)
        for other in others:
            other.receive()
        found += link.receive()
    return found


def frame(number: int, size: int = 8) -> bytes:
    """A whole frame that says ``number`` and is the longer, the larger ``size``; any byte may be in it."""
    payload = number.to_bytes(4, "big") + bytes((number * 31 + k * 7) % 255 + 1 for k in range(size))
    return Codec().encode(Tunnel(Source(11, 195), 0, 0, 40_000, payload))


def number_of(data: bytes) -> int:
    """What ``frame`` was told."""
    (message,) = Codec().feed(data)
    assert isinstance(message, Tunnel)
    return int.from_bytes(message.payload[:4], "big")


def frames(found: Sequence[bytes]) -> list[bytes]:
    """All frames in what was received; each piece must consist of whole ones."""
    every = []
    for data in found:
        framer = Framer()
        pieces = [one.data for one in framer.feed(data)]
        assert framer.pending_bytes == 0
        assert b"".join(pieces) == data
        every += pieces
    return every


def memory() -> Pair:
    return Pair(*memory_pair())


def udp() -> Pair:
    there = UdpListener(UdpIn(HOST, 0), SimulatedClock())
    here = UdpCaller(UdpOut(HOST, there.address[1]))
    here.send(frame(0))
    gather(there, bool)
    return Pair(here, there)


def free_port() -> int:
    """A port that nobody had a moment ago."""
    link = UdpListener(UdpIn(HOST, 0), SimulatedClock())
    port = int(link.address[1])
    link.close()
    return port


def multicast() -> Pair:
    endpoint = Multicast(port=free_port(), interface=HOST)
    return Pair(MulticastLink(endpoint), MulticastLink(endpoint))


def tcp() -> Pair:
    clock = SimulatedClock()
    there = TcpListener(TcpIn(HOST, 0), clock)
    here = TcpCaller(TcpOut(HOST, there.address[1]), clock)
    meet(here, there)
    return Pair(here, there)


def meet(here: TcpCaller, there: TcpListener) -> None:
    while not (here.peers and there.peers):
        wait(here, there)
        here.receive()
        there.receive()


def serial() -> Pair:
    clock = SimulatedClock()
    near, far = os.openpty()
    tty.setraw(near)
    here = SerialPort(Serial(os.ttyname(far), 57600), clock)
    os.close(far)
    return Pair(here, Terminal(near, clock))


PAIRS: dict[str, Callable[[], Pair]] = {
    "memory": memory,
    "udp": udp,
    "multicast": multicast,
    "tcp": tcp,
    "serial": serial,
}
STREAMS = ("tcp", "serial")
