"""Nodes that talk all the time, for tests of the loop."""

from __future__ import annotations

from collections.abc import Sequence

from mavlink_bridge.node import Datagram

TICK = 2500


class Chatter:
    """Says when it is and a digest of all it has heard, so that any difference spreads."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.steps: list[int] = []
        self.received: list[tuple[int, bytes]] = []
        self._digest = 1

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        self.steps.append(now)
        for _, data in inbox:
            self.received.append((now, data))
            self._digest = (self._digest * 31 + int.from_bytes(data, "big")) % (1 << 61)
        return [Datagram("swarm", now.to_bytes(8, "big") + self._digest.to_bytes(8, "big"))]
