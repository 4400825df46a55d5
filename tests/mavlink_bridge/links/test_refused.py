"""A connection that is refused says so, until there is a peer."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import closing

import pytest

from companion.values.components import COMPONENT
from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.links.endpoints import TcpOut
from mavlink_bridge.links.link import Link, failure_of, memory_pair
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.messages import Source
from outrider.doctor.hearing import Hearing
from outrider.doctor.presence import nobody
from outrider.onboard.identify import Identification


@pytest.fixture
def port() -> Iterator[int]:
    """A port at which nobody listens."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        yield taken.getsockname()[1]


def until(link: Link, connected: bool) -> None:
    clock = WallClock()
    for _ in range(500):
        link.receive()
        if bool(failure_of(link)) != connected:
            return
        clock.wait_until(clock.now() + 10_000)


def test_it_is_said_where_it_is_and_no_longer_once_there_is_a_peer(port: int) -> None:
    with closing(open_link(TcpOut("127.0.0.1", port), WallClock())) as link:
        until(link, connected=False)
        assert failure_of(link) == "Connection refused"
        known = Identification(link, f"tcp:127.0.0.1:{port}", Source(1, COMPONENT), None)
        known.look(0)
        assert known.waiting.endswith("; no connection: Connection refused")


def test_a_peer_takes_the_failure_away() -> None:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        with closing(open_link(TcpOut("127.0.0.1", server.getsockname()[1]), WallClock())) as link:
            until(link, connected=False)
            assert failure_of(link) == "Connection refused"
            server.listen()
            until(link, connected=True)
            assert failure_of(link) == ""


def test_a_link_that_knows_no_failure_has_none() -> None:
    assert failure_of(memory_pair()[0]) == ""


def test_the_doctor_says_it() -> None:
    hearing = Hearing()
    hearing.failure = "Connection refused"
    finding = nobody(hearing, None, log=False)
    assert finding.what == "no connection: Connection refused"
    assert "udpin:" in finding.do
