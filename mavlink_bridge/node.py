"""The contract of every node: bytes in, bytes out, time as an argument. No socket, no clock, no sleep."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol


class Datagram(NamedTuple):
    """Some whole MAVLink frames, and the link they came by or shall leave by.

    ``link`` is one of the names that the node declares (``autopilot``, ``swarm``, ``target``, …).
    """

    link: str
    data: bytes


class Node(Protocol):
    """A sans-I/O participant: a companion, an emulated autopilot, a target."""

    @property
    def name(self) -> str:
        """Unique among the nodes of a run; seeds and log files are named after it."""
        ...

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Handle what arrived, advance to ``now`` (µs, never decreasing) and return what to send."""
        ...
