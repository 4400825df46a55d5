"""Backup node in measured fleet time: it takes the time of its companion, whose clock it shares."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pymavlink.dialects.v20 import all as mavlink

from companion.backup_node import BackupNode
from companion.values.components import COMPONENT
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.messages import GpsGlobalOrigin, Tunnel
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.fleet_time import PAYLOAD_TYPE, unpack
from mavlink_bridge.wire.signing import Signing

_JUMP_US = 50_000
"""Change of fleet time between two messages above which it has jumped; it is at most 1 % fast otherwise."""


class FleetTimeBackup:
    """Backup ``Node`` of ``system`` whose plans are in the fleet time that its companion reports.

    ``make`` returns a new ``BackupNode``; ``signing`` is this node's own instance. The backup node is stepped
    in fleet time, once that is known. When fleet time jumps, a new one begins, because all that the old one
    dated is in another time. A jump happens only before the companion has announced a plan.
    """

    def __init__(self, system: int, make: Callable[[], BackupNode], signing: Signing | None = None) -> None:
        self._make, self._node = make, make()
        self.name = self._node.name
        self._ahead: int | None = None
        self._carried = 0
        self._signing = signing
        self._codecs = {
            "autopilot": Codec(
                lambda identifier, sender, component: (
                    (sender, component) == (system, mavlink.MAV_COMP_ID_AUTOPILOT1)
                    and identifier == mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
                ),
                signing,
            ),
            "swarm": Codec(
                lambda identifier, sender, component: (
                    (sender, component) == (system, COMPONENT) and identifier == mavlink.MAVLINK_MSG_ID_TUNNEL
                ),
                signing,
            ),
        }
        # The last datagram with the autopilot's origin, which may not come again, for the next backup node.
        self._origin: Datagram | None = None
        self._begins = True

    @property
    def carried(self) -> int:
        """Number of set-points that were sent in the companion's place."""
        return self._carried + self._node.carried

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Step the backup node at ``now`` (µs, own clock); before fleet time is known nothing happens."""
        if self._signing is not None:
            self._signing.present(now)
        for datagram in inbox:
            for message in self._codecs[datagram.link].feed(datagram.data, whole=True):
                if isinstance(message, Tunnel) and message.payload_type == PAYLOAD_TYPE:
                    self._receive(message.payload)
                elif isinstance(message, GpsGlobalOrigin):
                    self._origin = datagram
        if self._ahead is None:
            return []
        earlier = [] if self._origin is None or not self._begins else [self._origin]
        self._begins = False
        return self._node.step(now + self._ahead, [*earlier, *inbox])

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
