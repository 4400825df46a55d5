"""Simulated network: broadcast channels with seeded delay, loss, duplication, reordering and partitions.

Every path (channel, sender, receiver) draws from its own generator. A run therefore depends on the seed and
on names, never on the order in which nodes are listed or stepped, and a change on one path changes no draw of
another.
"""

from __future__ import annotations

from collections.abc import Iterable
from heapq import heappop, heappush
from random import Random
from typing import NamedTuple
from zlib import crc32

from mavlink_bridge.errors import BridgeError
from mavlink_bridge.network.channel import Channel, Faults
from mavlink_bridge.network.radio_range import RadioRange
from mavlink_bridge.node import Datagram

__all__ = ["Channel", "Faults", "NetworkCounters", "SimulatedNetwork"]


class NetworkCounters(NamedTuple):
    """Counts of datagrams on channels that are counted; each datagram counts once per receiver.

    The sum sent + duplicated equals delivered + dropped + still under way. ``dropped``: lost, cut off,
    out of range, or arrived at a full buffer; ``unrouted``: datagrams on a link that no channel carries.
    """

    sent: int
    delivered: int
    dropped: int
    duplicated: int
    unrouted: int


_Queue = list[tuple[int, str, int, int, Datagram]]
_FOREVER = 1 << 63


class _Path:
    """Path from one sender over one channel to one receiver; blocked before ``blocked_until`` (µs)."""

    __slots__ = (
        "blocked_until",
        "channel",
        "deterministic",
        "faults",
        "held",
        "latency",
        "link",
        "lost",
        "queue",
        "random",
        "receiver",
        "sender",
    )

    def __init__(
        self, channel: Channel, sender: str, receiver: str, queue: _Queue, seed: int, tick: int
    ) -> None:
        self.channel, self.sender, self.receiver = channel.name, sender, receiver
        self.apply(channel.between(sender, receiver))
        self.link = channel.members[receiver]
        self.queue = queue
        self.blocked_until = 0
        self.random = Random(crc32(f"{seed}\0{channel.name}\0{sender}\0{receiver}".encode())).random
        self.held: tuple[str, int, int, Datagram] | None = None
        self.lost: bool | None = None
        self.latency = max(self.faults.delay, tick)

    def apply(self, faults: Faults) -> None:
        """Apply ``faults`` from now on."""
        self.faults = faults
        # Without random faults: the usual case, which draws no random number.
        self.deterministic = not any((faults.jitter, faults.loss, faults.duplication, faults.reordering))

    def loses(self) -> bool:
        """Return whether the next datagram is lost; one random draw, none if ``loss`` is zero."""
        faults = self.faults
        if not faults.loss:
            return False
        share = faults.loss
        if self.lost is not None:
            share = faults.loss_after_loss if self.lost else faults.loss_after_passing
        self.lost = self.random() < share
        return self.lost


class _Cut(NamedTuple):
    """Partition between ``members`` and all others, in force until ``until`` (µs)."""

    channel: str | None
    members: frozenset[str]
    until: int

    def blocks(self, path: _Path) -> bool:
        inside = (path.sender in self.members) != (path.receiver in self.members)
        return inside and self.channel in (None, path.channel)


class _Buffer(NamedTuple):
    """Input buffer of a node that does not receive: at most ``room`` datagrams."""

    room: int
    waiting: list[Datagram]


class SimulatedNetwork:
    """All channels of a run.

    ``seed`` is the seed of the faults. ``tick`` (µs): least time from sending to arrival.
    Raises BridgeError for invalid faults and for two channels of one name.
    """

    def __init__(self, channels: Iterable[Channel], seed: int, tick: int) -> None:
        self._tick = tick
        self._queues: dict[str, _Queue] = {}
        self._paths: dict[tuple[str, str], list[list[_Path]]] = {}
        self._sequences: dict[str, int] = {}
        self._buffers: dict[str, _Buffer] = {}
        self._ranges: dict[str, RadioRange] = {}
        self._cuts: list[_Cut] = []
        self._sent = self._delivered = self._dropped = self._duplicated = self._unrouted = 0
        self._names: set[str] = set()
        self._uncounted: set[str] = set()
        for channel in sorted(channels, key=lambda channel: channel.name):
            channel.check()
            if channel.name in self._names:
                raise BridgeError(f"two channels are named {channel.name!r}")
            self._names.add(channel.name)
            if not channel.counted:
                self._uncounted.update(channel.members.values())
            for sender, link in channel.members.items():
                self._queues.setdefault(sender, [])
                self._sequences.setdefault(sender, 0)
                self._paths.setdefault((sender, link), []).append(
                    [
                        _Path(channel, sender, receiver, self._queues.setdefault(receiver, []), seed, tick)
                        for receiver in channel.members
                        if receiver != sender
                    ]
                )

    @property
    def counters(self) -> NetworkCounters:
        """Counts since the beginning."""
        return NetworkCounters(self._sent, self._delivered, self._dropped, self._duplicated, self._unrouted)

    @property
    def under_way(self) -> int:
        """Number of datagrams that are queued, held back for reordering, or buffered for a node."""
        held = sum(path.held is not None for path in self._all_paths())
        waiting = sum(len(buffer.waiting) for buffer in self._buffers.values())
        return held + waiting + sum(map(len, self._queues.values()))

    def send(self, now: int, sender: str, datagrams: Iterable[Datagram]) -> None:
        """Send the datagrams that ``sender`` emits at ``now`` (µs)."""
        for link, data in datagrams:
            branches = self._paths.get((sender, link))
            if branches is None:
                self._unrouted += 1
                continue
            for paths in branches:
                number = self._sequences[sender]
                self._sequences[sender] = number + 1
                if link not in self._uncounted:
                    self._sent += len(paths)
                if self._ranges and paths and paths[0].channel in self._ranges:
                    paths = self._within_range(now, sender, paths)
                latency, link_name, arrival = -1, "", None
                for path in paths:
                    if path.deterministic and now >= path.blocked_until:
                        # Most receivers share latency and link name; they then share one queue entry.
                        if arrival is None or path.latency != latency or path.link != link_name:
                            latency, link_name = path.latency, path.link
                            arrival = (now + latency, sender, number, 1, Datagram(link_name, data))
                        heappush(path.queue, arrival)
                    else:
                        self._carry(now, number, path, data)

    def limit(self, channel: str, radio: RadioRange) -> None:
        """Deliver on ``channel`` only what is sent within the range of ``radio``, from now on.

        The other datagrams are dropped, without a random draw. Raises BridgeError for a channel that does not
        exist.
        """
        self._require(channel)
        self._ranges[channel] = radio

    def _within_range(self, now: int, sender: str, paths: list[_Path]) -> list[_Path]:
        """Return the ``paths`` to the nodes within range of ``sender``, and count the others as dropped."""
        hearing = self._ranges[paths[0].channel].hearing(now, sender)
        found = [path for path in paths if path.receiver in hearing]
        if paths[0].link not in self._uncounted:
            self._dropped += len(paths) - len(found)
        return found

    def _require(self, channel: str) -> None:
        if channel not in self._names:
            raise BridgeError(f"no channel is named {channel!r}; there are {', '.join(sorted(self._names))}")

    def receive(self, now: int, node: str) -> list[Datagram]:
        """Return the datagrams that have reached ``node`` by ``now`` (µs) since the last call.

        They are sorted by arrival time, sender, and order of sending; buffered ones come first.
        """
        if node in self._buffers:
            self.keep(now, node, self._buffers[node].room)
            arrived = self._buffers.pop(node).waiting
        else:
            queue = self._queues.get(node)
            if not queue or queue[0][0] > now:
                return []
            arrived = self._arrivals(now, node)
        self._delivered += len(arrived)
        if self._uncounted:
            self._delivered -= sum(datagram.link in self._uncounted for datagram in arrived)
        return arrived

    def keep(self, now: int, node: str, room: int) -> None:
        """Buffer the datagrams that have reached ``node`` by ``now`` (µs) until its next ``receive``.

        The buffer holds ``room`` datagrams. When it is full, the newest are dropped, as by a socket.
        """
        waiting = self._buffers[node].waiting if node in self._buffers else []
        waiting += self._arrivals(now, node)
        self._dropped += max(len(waiting) - room, 0)
        del waiting[room:]
        self._buffers[node] = _Buffer(room, waiting)

    def cut(self, channel: str | None, members: Iterable[str], until: int | None = None) -> None:
        """Block all traffic between ``members`` and the others on ``channel`` (None: on any channel).

        It affects datagrams sent from now on and before ``until`` (µs; None: until healed). Datagrams under
        way still arrive. Raises BridgeError for a channel or a member that does not exist.
        """
        inside = frozenset(members)
        if channel is not None:
            self._require(channel)
        for name in sorted(inside - self._queues.keys()):
            raise BridgeError(f"no node is named {name!r}; there are {', '.join(sorted(self._queues))}")
        self._cuts.append(_Cut(channel, inside, _FOREVER if until is None else until))
        self._update_blocking()

    def heal(self, channel: str | None = None, members: Iterable[str] | None = None) -> None:
        """End the cuts made with the same ``channel`` and ``members``; None matches every cut."""
        inside = None if members is None else frozenset(members)
        self._cuts = [
            cut
            for cut in self._cuts
            if (channel is not None and cut.channel != channel)
            or (inside is not None and cut.members != inside)
        ]
        self._update_blocking()

    def lose(self, channels: tuple[str, ...], share: float) -> None:
        """Set the loss to ``share`` (0…1) on all channels whose names begin with one of ``channels``.

        It applies to datagrams sent from now on. Losses are then independent of each other. Raises
        BridgeError for a share outside 0…1.
        """
        if not 0.0 <= share <= 1.0:
            raise BridgeError(f"loss = {share} is not in 0…1")
        for path in self._all_paths():
            if path.channel.startswith(channels):
                path.apply(path.faults._replace(loss=share, burst=0.0))
                path.lost = None

    def _all_paths(self) -> Iterable[_Path]:
        return (path for branches in self._paths.values() for paths in branches for path in paths)

    def _update_blocking(self) -> None:
        for path in self._all_paths():
            path.blocked_until = max((cut.until for cut in self._cuts if cut.blocks(path)), default=0)

    def _arrivals(self, now: int, node: str) -> list[Datagram]:
        queue = self._queues.get(node)
        arrived: list[Datagram] = []
        while queue and queue[0][0] <= now:
            arrived.append(heappop(queue)[4])
        return arrived

    def _carry(self, now: int, number: int, path: _Path, data: bytes) -> None:
        _, jitter, _, duplication, reordering, _ = path.faults
        random = path.random
        # A fault of zero draws no random number.
        if now < path.blocked_until or path.loses():
            self._dropped += 1
            return
        datagram = Datagram(path.link, data)
        copies = 1
        if duplication and random() < duplication:
            copies = 2
            self._duplicated += 1
        if reordering and random() < reordering and path.held is None:
            path.held = (path.sender, number, 0, datagram)
            copies -= 1
            if not copies:
                return
        for copy in range(copies):
            latency = path.faults.delay + int(random() * (jitter + 1)) if jitter else path.latency
            arrival = now + max(latency, self._tick)
            heappush(path.queue, (arrival, path.sender, number, copy + 1, datagram))
        if path.held is not None and path.held[1] != number:
            heappush(path.queue, (arrival + self._tick, *path.held))
            path.held = None
