"""What cannot be opened is refused, and leaves nothing open."""

from __future__ import annotations

import gc
import os

import pytest

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.errors import BridgeError, LinkError
from mavlink_bridge.links.endpoints import TcpIn, UdpIn
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.links.tcp import TcpListener
from mavlink_bridge.links.udp import UdpListener
from tests.mavlink_bridge.link_pairs import HOST


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("udpin:192.0.2.1:14550", "cannot listen there"),
        ("tcpin:192.0.2.1:14550", "cannot listen there"),
        ("udpin:no.such.host.invalid:14550", "has no address"),
        ("tcp:a..b:14550", "has no address"),
        ("udpout:255.255.255.255:14550", "use mcast: to reach several"),
        ("mcast:239.1.1.1:14550,192.0.2.1", "cannot join"),
        ("/dev/no-such-port,57600", "No such file"),
        (f"{os.devnull},57600", "not a serial port"),
        ("tlog:/no/such/log.tlog", "cannot be read"),
    ],
)
def test_what_cannot_be_opened_is_said_in_one_line_and_leaves_nothing_open(text: str, said: str) -> None:
    gc.collect()
    before = set(os.listdir("/dev/fd"))
    with pytest.raises(BridgeError) as caught:
        open_link(text, SimulatedClock())
    assert set(os.listdir("/dev/fd")) == before
    message = str(caught.value)
    assert said in message
    assert text.partition(":")[2] in message
    assert "\n" not in message


@pytest.mark.parametrize("kind", [UdpIn, TcpIn])
def test_a_port_has_one_listener(kind: type[UdpIn] | type[TcpIn]) -> None:
    first = open_link(kind(HOST, 0), SimulatedClock())
    assert isinstance(first, UdpListener | TcpListener)
    with pytest.raises(LinkError, match="in use"):
        open_link(kind(HOST, first.address[1]), SimulatedClock())
    first.close()
