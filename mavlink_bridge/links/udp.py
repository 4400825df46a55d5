"""Links over UDP: listening, sending first, and multicast; one datagram is one UDP packet."""

from __future__ import annotations

import socket
from ipaddress import IPv4Address
from typing import Any, Final

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.errors import LinkError
from mavlink_bridge.links.endpoints import Multicast, UdpIn, UdpOut
from mavlink_bridge.links.hosts import because, resolved
from mavlink_bridge.links.link import BURST, LinkCounters

Address = tuple[Any, ...]
"""Address as in the socket module: (host, port, …)."""

REMEMBERED: Final = 10_000_000
"""µs after a peer's last packet during which a listening link sends to it; no limit for the latest peer."""
MOST_PEERS: Final = 32
"""Largest number of peers of a listening link."""
STEADY: Final = 3_000_000
"""µs without a packet after which a new peer may replace the most silent of ``MOST_PEERS`` peers."""
_MAX_PACKET_BYTES: Final = 65536
# The system's default buffer holds some 250 packets: less than a swarm sends while one plan is being solved
# on a busy host.
_RECEIVE_BUFFER_BYTES: Final = 1 << 20


class _Udp:
    """Common base of the three links; ``receiver`` and ``sender`` may be one socket."""

    def __init__(self, receiver: socket.socket, sender: socket.socket) -> None:
        self._receiver, self._sender = receiver, sender
        self._received = self._sent = self._dropped = 0
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
        receiver.setblocking(False)
        sender.setblocking(False)
        self._fileno = receiver.fileno()

    @property
    def counters(self) -> LinkCounters:
        """Counts; a packet to several peers counts once."""
        return LinkCounters(self._received, self._sent, self._dropped)

    @property
    def address(self) -> Address:
        """Local address of the receiving socket: host, port, …."""
        address: Address = self._receiver.getsockname()
        return address

    def fileno(self) -> int:
        """Return the receiving socket's file descriptor."""
        return self._fileno

    def receive(self) -> list[bytes]:
        """Return the accepted packets that have arrived, at most ``BURST``."""
        found: list[bytes] = []
        for _ in range(BURST):
            try:
                data, source = self._receiver.recvfrom(_MAX_PACKET_BYTES)
            except ConnectionError:
                continue  # reports that a packet sent earlier was refused; received packets may still wait
            except OSError:
                break
            if self._accepts(source) and data:
                found.append(data)
        self._received += len(found)
        return found

    def send(self, data: bytes) -> None:
        """Send one packet to every peer."""
        if self._send(data):
            self._sent += 1
        else:
            self._dropped += 1

    def close(self) -> None:
        """Close both sockets."""
        self._receiver.close()
        self._sender.close()

    def _accepts(self, source: Address) -> bool:
        """Return whether packets from ``source`` are accepted."""
        return True

    def _send(self, data: bytes) -> bool:
        """Send to the connected peer; on a refusal, repeat once, because it concerned an earlier packet."""
        for _ in range(2):
            try:
                self._sender.send(data)
            except ConnectionError:
                continue
            except OSError:
                return False
            return True
        return False


class UdpListener(_Udp):
    """Link of ``udpin``: a bound socket that sends to all peers of the last 10 s, or else to the latest one.

    Of more than ``MOST_PEERS`` peers, those that continue to send are kept. Packets of a further peer are
    received, but nothing is sent to it: otherwise a sender with many ports could displace all other peers.

    This matches pymavlink and differs from mavlink-router's server mode, which sends to the latest peer only:
    of two peers (an autopilot's two ports, a ground station and a script) each would then receive half of the
    stream. The link always sends to the endpoint's ``peer``, too, if there is one.
    """

    def __init__(self, endpoint: UdpIn, clock: Clock) -> None:
        family, address = resolved(endpoint, endpoint.host, endpoint.port, socket.SOCK_DGRAM)
        self._always: tuple[Address, ...] = ()
        if endpoint.peer is not None:
            self._always = (_peer_address(endpoint, *endpoint.peer, family),)
        one = socket.socket(family, socket.SOCK_DGRAM)
        try:
            one.bind(address)
        except OSError as error:
            one.close()
            raise LinkError(f"{endpoint}: cannot listen there: {because(error)}") from None
        super().__init__(one, one)
        self._clock = clock
        self._peers: dict[Address, int] = {}

    @property
    def peers(self) -> int:
        """Number of peers, at most ``MOST_PEERS``, that sent in the last 10 s."""
        now = self._clock.now()
        return sum(now - time <= REMEMBERED for time in self._peers.values())

    def _accepts(self, source: Address) -> bool:
        # Each call makes a new dictionary, because the sending thread may be iterating over the old one. The
        # dictionary is sorted by time, the latest sender last.
        now = self._clock.now()
        peers = {
            peer: time for peer, time in self._peers.items() if peer != source and now - time <= REMEMBERED
        }
        if len(peers) >= MOST_PEERS:
            silent = next(iter(peers))
            if now - peers[silent] <= STEADY:
                return True
            del peers[silent]
        peers[source] = now
        self._peers = peers
        return True

    def _send(self, data: bytes) -> bool:
        peers, now = self._peers, self._clock.now()
        recent = [peer for peer, time in peers.items() if now - time <= REMEMBERED] or list(peers)[-1:]
        recent += [peer for peer in self._always if peer not in recent]
        reached = 0
        for peer in recent:
            try:
                self._sender.sendto(data, peer)
            except OSError:
                continue
            reached += 1
        return reached > 0


def _peer_address(endpoint: UdpIn, host: str, port: int, family: socket.AddressFamily) -> Address:
    found, address = resolved(endpoint, host, port, socket.SOCK_DGRAM)
    if found is not family:
        raise LinkError(f"{endpoint}: one is an IPv4 and the other an IPv6 address; allowed: both the same")
    return address


class UdpCaller(_Udp):
    """Link of ``udpout``: a connected socket, so that only the peer's packets are received."""

    def __init__(self, endpoint: UdpOut) -> None:
        family, address = resolved(endpoint, endpoint.host, endpoint.port, socket.SOCK_DGRAM)
        one = socket.socket(family, socket.SOCK_DGRAM)
        try:
            one.connect(address)
        except OSError as error:
            one.close()
            hint = "; use mcast: to reach several" if isinstance(error, PermissionError) else ""
            raise LinkError(f"{endpoint}: cannot send there: {because(error)}{hint}") from None
        super().__init__(one, one)


class MulticastLink(_Udp):
    """Link of ``mcast``: every other member of the group receives, on this machine, too.

    The link drops the echo of its own packets. It has two sockets: one bound to the group's port, to receive,
    and one with an address of its own, by which the echo is recognised. The time to live is 0 on a loopback
    interface, so that nothing leaves the machine; otherwise it is 1.
    """

    def __init__(self, endpoint: Multicast) -> None:
        receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._join(endpoint, receiver, sender)
        except OSError as error:
            receiver.close()
            sender.close()
            hint = "" if endpoint.interface else f"; within this machine use {endpoint},127.0.0.1"
            raise LinkError(f"{endpoint}: cannot join: {because(error)}{hint}") from None
        super().__init__(receiver, sender)
        self._own: Address = sender.getsockname()

    def _join(self, endpoint: Multicast, receiver: socket.socket, sender: socket.socket) -> None:
        group = socket.inet_aton(endpoint.group)
        interface = socket.inet_aton(endpoint.interface or "0.0.0.0")
        local = endpoint.interface is not None and IPv4Address(endpoint.interface).is_loopback
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if hasattr(socket, "SO_REUSEPORT"):
            # Systems other than Linux need it for several members on one machine.
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        # Bound to the group, so that other packets to this port are not received.
        receiver.bind((endpoint.group, endpoint.port))
        receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + interface)
        if endpoint.interface is not None:
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
            sender.bind((endpoint.interface, 0))
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0 if local else 1)
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
        # A connected socket has one source address, by which the echo is recognised.
        sender.connect((endpoint.group, endpoint.port))

    def _accepts(self, source: Address) -> bool:
        return source != self._own
