"""Part of a simulated network: that of the nodes that one of several processes steps.

Every process builds the same channels and keeps the paths to its own nodes. What a node of its own sends to
nodes elsewhere is handed to the other processes, which put it on their paths as if it had been sent there.
Each path has its own random generator and is in one process only, so the datagrams are those of a single
process, bit for bit.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import NamedTuple

from mavlink_bridge.network.channel import Channel
from mavlink_bridge.network.simulated import SimulatedNetwork
from mavlink_bridge.node import Datagram


class Sent(NamedTuple):
    """Datagrams that node ``sender`` sent at ``time`` (µs) to nodes elsewhere."""

    time: int
    sender: str
    datagrams: list[Datagram]


class NetworkPart(SimulatedNetwork):
    """Part of the network for the nodes in ``own``; the other arguments are those of the whole network."""

    def __init__(self, channels: Iterable[Channel], seed: int, tick: int, own: Collection[str]) -> None:
        super().__init__(channels, seed, tick)
        self._outgoing: list[Sent] = []
        self._leaving: set[tuple[str, str]] = set()
        for (sender, link), branches in self._paths.items():
            for paths in branches:
                if sender in own and any(path.receiver not in own for path in paths):
                    self._leaving.add((sender, link))
                paths[:] = [path for path in paths if path.receiver in own]

    def send(self, now: int, sender: str, datagrams: Iterable[Datagram]) -> None:
        """Send the datagrams that a node of this process emits at ``now`` (µs)."""
        if not self._leaving:
            super().send(now, sender, datagrams)
            return
        datagrams = list(datagrams)
        super().send(now, sender, datagrams)
        leaving = [datagram for datagram in datagrams if (sender, datagram.link) in self._leaving]
        if leaving:
            self._outgoing.append(Sent(now, sender, leaving))

    def outgoing(self) -> list[Sent]:
        """Return and forget what was sent to nodes elsewhere since the last call."""
        found, self._outgoing = self._outgoing, []
        return found

    def admit(self, sent: Iterable[Sent]) -> None:
        """Put datagrams of nodes elsewhere on the paths to the nodes of this process.

        They must not be due yet: the processes exchange datagrams at least once per ``least_delay``.
        """
        for time, sender, datagrams in sorted(sent, key=lambda one: one[:2]):
            super().send(time, sender, datagrams)


def least_delay(channels: Iterable[Channel], tick: int, place: dict[str, int]) -> int | None:
    """Return the least delay (µs) between nodes in different places; None if no channel connects any.

    ``place``: node name → process. ``tick`` (µs) is the least delay of the network.
    """
    return min(
        (
            max(channel.between(sender, receiver).delay, tick)
            for channel in channels
            for sender in channel.members
            for receiver in channel.members
            if place[sender] != place[receiver]
        ),
        default=None,
    )
