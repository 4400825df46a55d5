"""Interface of every node: bytes in, bytes out, time as an argument; no socket, no clock, no sleep."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol


class Datagram(NamedTuple):
    """One or more complete MAVLink frames, and the link on which they arrived or will leave.

    ``link`` is one of the names that the node declares (``autopilot``, ``swarm``, ``target``, …).
    """

    link: str
    data: bytes


class Node(Protocol):
    """Sans-I/O participant: a companion, an emulated autopilot, a target."""

    @property
    def name(self) -> str:
        """Name, unique among the nodes of a run; seeds and names of log files are derived from it."""
        ...

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Handle ``inbox``, advance to ``now`` (µs, never decreasing) and return the datagrams to send."""
        ...
