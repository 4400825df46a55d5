"""A vehicle that is not of the ring: it says where it is, shares no plan, and hears nothing of the others."""

from __future__ import annotations

from collections.abc import Sequence

from companion.node import Companion
from mavlink_bridge.node import Datagram

DEAF_TO = "swarm"


class Bystander(Companion):
    """A companion that does not listen on the swarm link: who hovers, or comes through, and gives way to
    nobody."""

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """As every companion, alone in the world."""
        return super().step(now, [datagram for datagram in inbox if datagram.link != DEAF_TO])
