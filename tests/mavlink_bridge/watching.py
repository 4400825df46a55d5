"""A tap that keeps what it sees."""

from __future__ import annotations

from collections.abc import Sequence

from mavlink_bridge.loops.lockstep import Direction
from mavlink_bridge.node import Datagram

Event = tuple[int, str, str, Datagram]


class Watcher:
    """``events``: datagrams with the time, the node and the direction; ``steps``: when each began one."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.steps: list[tuple[int, str]] = []

    def begin(self, now: int, node: str, /) -> None:
        self.steps.append((now, node))

    def __call__(self, now: int, node: str, direction: Direction, datagrams: Sequence[Datagram], /) -> None:
        self.events += [(now, node, direction, datagram) for datagram in datagrams]
