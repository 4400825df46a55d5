"""Backup node in measured fleet time: it takes the time of its companion, whose clock it shares."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from companion.backup.links import Links
from companion.backup_node import BackupNode
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.messages import GpsGlobalOrigin, Message, Tunnel
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.fleet_time import PAYLOAD_TYPE, unpack
from mavlink_bridge.wire.signing import Signing

_JUMP_US = 50_000
"""Change of fleet time between two messages above which it has jumped; it is at most 1 % fast otherwise."""


class FleetTimeBackup:
    """Backup ``Node`` of ``system`` whose plans are in the fleet time that its companion reports.

    ``make`` returns a new ``BackupNode`` that signs with ``signing``, which is not the companion's instance.
    The backup node is stepped in fleet time, once that is known. When fleet time jumps, a new one begins,
    because all that the old one dated is in another time. A jump happens only before the companion has
    announced a plan.
    """

    def __init__(self, system: int, make: Callable[[], BackupNode], signing: Signing | None = None) -> None:
        self._make, self._node = make, make()
        self.name = self._node.name
        self._ahead: int | None = None
        self._carried = 0
        self._links = Links(system, signing)
        # The autopilot's last origin, which may not come again, for the next backup node.
        self._origin: GpsGlobalOrigin | None = None
        self._begins = True

    @property
    def carried(self) -> int:
        """Number of set-points that were sent in the companion's place."""
        return self._carried + self._node.carried

    @property
    def steers(self) -> bool:
        """Whether the companion's last set-point agreed with its plan, see ``BackupNode``."""
        return self._node.steers

    def farewell(self, now: int) -> list[Message]:
        """Return the newest plan and the statement that it is the last one, see ``BackupNode.farewell``."""
        return [] if self._ahead is None else self._node.farewell(now + self._ahead)

    def hear(self, now: int, messages: Sequence[Message]) -> None:
        """Take note of the others' plans at ``now`` (µs, own clock), see ``BackupNode.hear``."""
        if self._ahead is not None:
            self._node.hear(now + self._ahead, messages)

    def rests(self, now: int, settling: int) -> bool:
        """Return whether no plan is flown at ``now`` (µs, own clock), or it has ended, see ``BackupNode``."""
        return self._ahead is None or self._node.rests(now + self._ahead, settling)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Step the backup node at ``now`` (µs, own clock); before fleet time is known nothing happens."""
        self.receive(now, self._links.decode(now, inbox))
        return self.advance(now)

    def receive(self, now: int, messages: Sequence[Message]) -> None:
        """Receive ``messages`` that the companion sent at ``now`` (µs, own clock), see ``BackupNode``."""
        for message in messages:
            if isinstance(message, Tunnel) and message.payload_type == PAYLOAD_TYPE:
                self._receive(message.payload)
            elif isinstance(message, GpsGlobalOrigin):
                self._origin = message
        if self._ahead is None:
            return
        earlier = [] if self._origin is None or not self._begins else [self._origin]
        self._begins = False
        self._node.receive(now + self._ahead, [*earlier, *messages])

    def advance(self, now: int) -> list[Datagram]:
        """Do a step at ``now`` (µs, own clock); nothing happens before fleet time is known."""
        return [] if self._ahead is None else self._node.advance(now + self._ahead)

    def _receive(self, payload: bytes) -> None:
        """Take the companion's fleet time; one that it does not know changes nothing."""
        try:
            ahead = unpack(payload).ahead
        except PlanWireError:
            return
        if ahead is None:
            return
        if self._ahead is not None and abs(ahead - self._ahead) > _JUMP_US:
            self._carried += self._node.carried
            self._node, self._begins = self._make(), True
        self._ahead = ahead
