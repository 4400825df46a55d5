"""Node behind impaired links.

Datagrams arrive unimpaired over the loopback; the scenario's faults then delay, drop and reorder them, by the
simulated network that lock-step flights use.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from mavlink_bridge.loops.lockstep import Direction, StepObserver
from mavlink_bridge.network.simulated import Channel, SimulatedNetwork
from mavlink_bridge.node import Datagram, Node
from mavlink_bridge.wire.header import sending_system
from outrider.runs import names
from sitl.camera.scene import LINK as SIGHT


class ImpairedLink:
    """``node`` behind ``network``, of which each channel leads from one sender to ``node``.

    ``senders``: for each link the node at its other end, or None if there are several; the system id in the
    header then identifies the sender; ``target`` is that of the target. Data from other
    senders, possible on a multicast group, is dropped.
    """

    def __init__(
        self,
        node: Node,
        senders: Mapping[str, str | None],
        channels: Sequence[Channel],
        seed: int,
        tick: int,
        target: int,
    ) -> None:
        self.node = node
        self._target = target
        self._senders = senders
        self._channels = [channel.name for channel in channels]
        self._known = {end for channel in channels for end in channel.members.items() if end[0] != node.name}
        self.network = SimulatedNetwork(channels, seed, tick)
        self._last: tuple[int, list[Datagram], list[Datagram]] | None = None

    @property
    def name(self) -> str:
        """The node's name."""
        return self.node.name

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Step the node with the datagrams that the simulated network delivers by ``now`` (µs)."""
        for datagram in inbox:
            sender = self._senders.get(datagram.link) or self._sender(datagram)
            if (sender, datagram.link) in self._known:
                self.network.send(now, sender, [datagram])
        delivered = self.network.receive(now, self.node.name)
        self._last = now, delivered, []
        leaving = self.node.step(now, delivered)
        self._last = now, delivered, leaving
        return leaving

    def show(self, taps: Sequence[StepObserver]) -> None:
        """Pass the node's last step, with delivered and sent datagrams, to ``taps``; once per step."""
        if self._last is None:
            return
        (now, delivered, leaving), self._last = self._last, None
        boxes: tuple[tuple[Direction, list[Datagram]], ...] = (("in", delivered), ("out", leaving))
        for tap in taps:
            tap.begin(now, self.name)
            for direction, box in boxes:
                if box:
                    tap(now, self.name, direction, box)

    def _sender(self, datagram: Datagram) -> str:
        """Return the name of the node with the system id in the header."""
        system = sending_system(datagram.data)
        moving = names.moving(system)
        if (moving, datagram.link) in self._known:
            return moving
        if datagram.link != SIGHT:
            return names.companion(system)
        return names.TARGET if system == self._target else names.autopilot(system)

    def cut(self, members: Iterable[str]) -> None:
        """Block the swarm's channels between ``members`` and others."""
        inside = list(members)
        for channel in self._swarm:
            self.network.cut(channel, inside)

    def heal(self, members: Iterable[str]) -> None:
        """End the block of the swarm's channels between ``members`` and others."""
        inside = list(members)
        for channel in self._swarm:
            self.network.heal(channel, inside)

    @property
    def _swarm(self) -> list[str]:
        return [name for name in self._channels if name.startswith("swarm")]
