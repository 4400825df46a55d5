"""Number of clients of a vehicle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.streams import StreamLink
from mavlink_bridge.links.udp import REMEMBERED, UdpCaller, UdpListener


class Clients:
    """Counter of the clients on the ``links`` of each vehicle, by the vehicle's name.

    A TCP client counts while it is connected, a UDP client if it has sent something within the last 10 s.
    Clients on multicast are not counted, because its receivers are unknown.
    """

    def __init__(self, links: Mapping[str, Sequence[Link]], clock: Clock) -> None:
        self._links, self._clock = links, clock
        self._received: dict[Link, tuple[int, int]] = {}

    def __call__(self, name: str) -> int:
        """Return the number of clients of vehicle ``name``."""
        return sum(map(self._on, self._links[name]))

    def _on(self, link: Link) -> int:
        if isinstance(link, StreamLink | UdpListener):
            return link.peers
        return self._answered(link) if isinstance(link, UdpCaller) else 0

    def _answered(self, link: UdpCaller) -> int:
        """Return 1 if the only peer of ``link`` has sent something within the last 10 s, otherwise 0."""
        received, now = link.counters.received, self._clock.now()
        before, when = self._received.get(link, (0, -REMEMBERED))
        if received != before:
            when = now
        self._received[link] = received, when
        return int(now - when < REMEMBERED)
