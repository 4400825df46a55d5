"""The in-memory link: broadcast channels with seeded delay, loss, duplication, reordering and partitions.

Every path (channel, sender, receiver) draws from its own generator, so that a run depends on the seed and on
names, never on the order in which nodes are listed or stepped.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from heapq import heappop, heappush
from random import Random
from typing import NamedTuple
from zlib import crc32

from mavlink_bridge.errors import BridgeError
from mavlink_bridge.node import Datagram


class Faults(NamedTuple):
    """What a channel does to each datagram on its way to each receiver, independently.

    ``delay`` µs always, plus up to ``jitter`` µs, uniform; ``loss``, ``duplication``, ``reordering`` are
    probabilities in 0…1. A reordered datagram waits until one tick after the next one on its path has arrived
    (and for ever if none follows); jitter that exceeds the spacing of datagrams reorders too.
    """

    delay: int = 0
    jitter: int = 0
    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0


class Partition(NamedTuple):
    """From ``start`` until before ``end`` (µs, time of sending) nothing passes between ``members`` (node
    names) and the others."""

    start: int
    end: int
    members: frozenset[str]


class Channel(NamedTuple):
    """A broadcast domain: what a member sends on its link reaches every other under *their* link's name.

    ``members``: node name → name of its link into this channel.
    """

    name: str
    members: Mapping[str, str]
    faults: Faults = Faults()
    partitions: tuple[Partition, ...] = ()


class EtherCounters(NamedTuple):
    """Each datagram counts once per receiver: sent + duplicated = delivered + dropped + still under way.

    ``unrouted``: datagrams on a link that no channel carries.
    """

    sent: int
    delivered: int
    dropped: int
    duplicated: int
    unrouted: int


_Queue = list[tuple[int, str, int, int, Datagram]]


class _Path:
    """From one sender over one channel to one receiver."""

    __slots__ = ("cuts", "faults", "held", "link", "queue", "random")

    def __init__(self, channel: Channel, sender: str, receiver: str, queue: _Queue, seed: int) -> None:
        self.faults = channel.faults
        self.link = channel.members[receiver]
        self.queue = queue
        self.cuts = [
            (cut.start, cut.end)
            for cut in channel.partitions
            if (sender in cut.members) != (receiver in cut.members)
        ]
        self.random = Random(crc32(f"{seed}\0{channel.name}\0{sender}\0{receiver}".encode()))
        self.held: tuple[str, int, int, Datagram] | None = None


class Ether:
    """All channels of a run. ``seed`` of the faults; ``tick`` (µs): nothing arrives earlier than one tick
    after it was sent.

    Raises BridgeError for faults that make no sense and for two channels of one name.
    """

    def __init__(self, channels: Iterable[Channel], seed: int, tick: int) -> None:
        self._tick = tick
        self._queues: dict[str, _Queue] = {}
        self._paths: dict[tuple[str, str], list[list[_Path]]] = {}
        self._sequences: dict[str, int] = {}
        self._sent = self._delivered = self._dropped = self._duplicated = self._unrouted = 0
        names: set[str] = set()
        for channel in sorted(channels, key=lambda channel: channel.name):
            _check(channel)
            if channel.name in names:
                raise BridgeError(f"two channels are named {channel.name!r}")
            names.add(channel.name)
            for sender, link in channel.members.items():
                self._queues.setdefault(sender, [])
                self._sequences.setdefault(sender, 0)
                self._paths.setdefault((sender, link), []).append(
                    [
                        _Path(channel, sender, receiver, self._queues.setdefault(receiver, []), seed)
                        for receiver in channel.members
                        if receiver != sender
                    ]
                )

    @property
    def counters(self) -> EtherCounters:
        """The counts since the beginning."""
        return EtherCounters(self._sent, self._delivered, self._dropped, self._duplicated, self._unrouted)

    @property
    def under_way(self) -> int:
        """How many are queued or held back at present."""
        held = sum(path.held is not None for ways in self._paths.values() for way in ways for path in way)
        return held + sum(map(len, self._queues.values()))

    def send(self, now: int, sender: str, datagrams: Iterable[Datagram]) -> None:
        """Put what ``sender`` emits at ``now`` (µs) on its way."""
        for link, data in datagrams:
            ways = self._paths.get((sender, link))
            if ways is None:
                self._unrouted += 1
                continue
            for paths in ways:
                number = self._sequences[sender]
                self._sequences[sender] = number + 1
                self._sent += len(paths)
                for path in paths:
                    self._carry(now, sender, number, path, data)

    def receive(self, now: int, node: str) -> list[Datagram]:
        """What has reached ``node`` by ``now`` (µs) and is new, by arrival time, sender, order of sending."""
        queue = self._queues.get(node)
        arrived: list[Datagram] = []
        if queue is None:
            return arrived
        while queue and queue[0][0] <= now:
            arrived.append(heappop(queue)[4])
        self._delivered += len(arrived)
        return arrived

    def _carry(self, now: int, sender: str, number: int, path: _Path, data: bytes) -> None:
        delay, jitter, loss, duplication, reordering = path.faults
        random = path.random.random
        # A fault of zero draws nothing: a clean link costs no random numbers.
        if (path.cuts and any(start <= now < end for start, end in path.cuts)) or (loss and random() < loss):
            self._dropped += 1
            return
        datagram = Datagram(path.link, data)
        copies = 1
        if duplication and random() < duplication:
            copies = 2
            self._duplicated += 1
        if reordering and random() < reordering and path.held is None:
            path.held = (sender, number, 0, datagram)
            copies -= 1
            if not copies:
                return
        for copy in range(copies):
            way = delay + int(random() * (jitter + 1)) if jitter else delay
            arrival = now + max(way, self._tick)
            heappush(path.queue, (arrival, sender, number, copy + 1, datagram))
        if path.held is not None and path.held[1] != number:
            heappush(path.queue, (arrival + self._tick, *path.held))
            path.held = None


def _check(channel: Channel) -> None:
    faults = channel.faults
    for name in ("delay", "jitter"):
        if getattr(faults, name) < 0:
            raise BridgeError(f"channel {channel.name!r}: {name} = {getattr(faults, name)} µs is negative")
    for name in ("loss", "duplication", "reordering"):
        if not 0 <= getattr(faults, name) <= 1:
            raise BridgeError(f"channel {channel.name!r}: {name} = {getattr(faults, name)} is not in 0…1")
