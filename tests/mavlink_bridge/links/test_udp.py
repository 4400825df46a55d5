"""What is peculiar to UDP: who is answered, what is ignored, how far a multicast reaches."""

from __future__ import annotations

import socket
from collections.abc import Iterable

import pytest

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.errors import LinkError
from mavlink_bridge.links.endpoints import Multicast, UdpIn, UdpOut
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.links.udp import MOST_PEERS, REMEMBERED, STEADY, MulticastLink, UdpCaller, UdpListener
from tests.mavlink_bridge.link_pairs import HOST, frame, free_port, gather


def test_a_listener_answers_all_that_it_heard_lately_and_the_last_one_for_ever() -> None:
    clock = SimulatedClock()
    listener = UdpListener(UdpIn(HOST, 0), clock)
    early, late = (UdpCaller(UdpOut(HOST, listener.address[1])) for _ in range(2))
    listener.send(frame(1))
    assert listener.counters == (0, 0, 1)
    early.send(frame(2))
    gather(listener, bool)
    clock.wait_until(REMEMBERED)
    late.send(frame(3))
    gather(listener, bool)
    listener.send(frame(4))
    assert gather(early, bool) == gather(late, bool) == [frame(4)]
    clock.wait_until(REMEMBERED + 1)
    listener.send(frame(5))
    clock.wait_until(5 * REMEMBERED)
    listener.send(frame(6))
    assert gather(late, lambda found: len(found) == 2) == [frame(5), frame(6)]
    assert early.receive() == []
    for link in (listener, early, late):
        link.close()


def test_a_listener_answers_a_bounded_number_of_peers_and_those_that_speak_on_stay() -> None:
    clock = SimulatedClock()
    listener = UdpListener(UdpIn(HOST, 0), clock)
    callers = [UdpCaller(UdpOut(HOST, listener.address[1])) for _ in range(MOST_PEERS + 1)]
    *steady, late = callers
    silent = steady[7]

    def speak(who: Iterable[UdpCaller]) -> None:
        for caller in who:
            caller.send(frame(1))
            assert gather(listener, bool) == [frame(1)]

    speak(steady)
    for _ in range(5):
        clock.wait_until(clock.now() + STEADY // 3)
        speak(caller for caller in steady if caller is not silent)
        if clock.now() <= STEADY:
            # There is no room for one more, however often it speaks.
            speak([late] * 3)
            listener.send(frame(2))
            assert all(gather(caller, bool) == [frame(2)] for caller in steady)
            assert late.receive() == []
    speak([late])
    listener.send(frame(3))
    assert all(gather(caller, bool) == [frame(3)] for caller in callers if caller is not silent)
    assert silent.receive() == []
    for link in (listener, *callers):
        link.close()


def test_a_listener_with_a_peer_speaks_first_and_to_others_too() -> None:
    """As an autopilot's port: its ground station need say nothing, and is never forgotten."""
    clock = SimulatedClock()
    station = UdpListener(UdpIn(HOST, 0), clock)
    listener = UdpListener(UdpIn(HOST, 0, (HOST, station.address[1])), clock)
    listener.send(frame(1))
    assert gather(station, bool) == [frame(1)]
    assert listener.peers == 0
    other = UdpCaller(UdpOut(HOST, listener.address[1]))
    for speaker in (station, other):
        speaker.send(frame(2))
        gather(listener, bool)
    assert listener.peers == 2
    listener.send(frame(3))
    assert gather(station, bool) == gather(other, bool) == [frame(3)]
    clock.wait_until(2 * REMEMBERED)
    assert listener.peers == 0
    listener.send(frame(4))
    assert gather(station, bool) == [frame(4)]
    for link in (listener, station, other):
        link.close()


def test_a_listener_and_its_peer_speak_one_protocol() -> None:
    with pytest.raises(LinkError, match="one is an IPv4 and the other an IPv6 address"):
        open_link("udpin:127.0.0.1:0,[::1]:14550", SimulatedClock())


def test_a_caller_hears_nobody_but_whom_it_called() -> None:
    listener = UdpListener(UdpIn(HOST, 0), SimulatedClock())
    caller = UdpCaller(UdpOut(HOST, listener.address[1]))
    caller.send(frame(1))
    gather(listener, bool)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(frame(2), caller.address)
    listener.send(frame(3))
    assert gather(caller, bool) == [frame(3)]
    listener.close()
    caller.close()


def test_multicast_reaches_all_others_and_gives_no_echo() -> None:
    endpoint = Multicast(port=free_port(), interface=HOST)
    members = [MulticastLink(endpoint) for _ in range(3)]
    for number, member in enumerate(members):
        member.send(frame(number))
    for number, member in enumerate(members):
        found = gather(member, lambda found: len(found) >= 2)
        assert found == [frame(other) for other in range(3) if other != number]
        assert member.receive() == []
        member.close()


def test_what_else_comes_to_the_port_of_a_group_is_not_for_its_members() -> None:
    endpoint = Multicast(port=free_port(), interface=HOST)
    member, other = MulticastLink(endpoint), MulticastLink(endpoint)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(frame(1), (HOST, endpoint.port))
    other.send(frame(2))
    member.send(frame(3))
    # Of all sockets at the port the system would choose one for the stranger.
    assert gather(member, bool) == [frame(2)]
    assert gather(other, bool) == [frame(3)]
    member.close()
    other.close()


def test_multicast_on_a_loopback_interface_leaves_no_machine() -> None:
    link = MulticastLink(Multicast(port=free_port(), interface=HOST))
    assert link._sender.getsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL) == 0
    link.close()
