"""Bystander: a vehicle without the fleet's task that reports its position and ignores all other vehicles."""

from __future__ import annotations

from collections.abc import Sequence

from companion.node import Companion
from mavlink_bridge.node import Datagram

DEAF_TO = "swarm"


class Bystander(Companion):
    """Companion that receives nothing on the swarm link.

    It hovers or flies to its goal, and does not give way. Its settings (``Fleet.companion_config_of``)
    prevent it from sharing plans.
    """

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Step as every companion, without the datagrams of the swarm link."""
        return super().step(now, [datagram for datagram in inbox if datagram.link != DEAF_TO])
