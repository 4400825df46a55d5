"""How many clients a vehicle has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.streams import StreamLink
from mavlink_bridge.links.udp import REMEMBERED, UdpCaller, UdpListener


class Clients:
    """Asked now and then for the clients on a node's ``links``: who is connected, or was heard in the last
    10 s. Multicast does not count: nobody knows who is there."""

    def __init__(self, links: Mapping[str, Sequence[Link]], clock: Clock) -> None:
        self._links, self._clock = links, clock
        self._heard: dict[Link, tuple[int, int]] = {}

    def __call__(self, name: str) -> int:
        return sum(map(self._on, self._links[name]))

    def _on(self, link: Link) -> int:
        if isinstance(link, StreamLink | UdpListener):
            return link.peers
        return self._answered(link) if isinstance(link, UdpCaller) else 0

    def _answered(self, link: UdpCaller) -> int:
        """1 if its only peer has spoken."""
        received, now = link.counters.received, self._clock.now()
        before, when = self._heard.get(link, (0, -REMEMBERED))
        if received != before:
            when = now
        self._heard[link] = received, when
        return int(now - when < REMEMBERED)
