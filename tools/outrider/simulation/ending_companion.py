"""Companion in lock-step whose process may end, and what is sent on the swarm link in its place then.

In ``outrider fly`` the process of the backup node knows that the companion's process has ended, and tells the
others that the plan it flies is the last one. Here the same is sent from the companion's end of the link.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from companion.backup_node import BackupNode
from companion.fleet_time_backup import FleetTimeBackup
from companion.node import Companion
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec

_FAREWELL_US: Final = 100_000
"""Time between two announcements that the plan is the last one (µs)."""


class EndingCompanion:
    """Node of ``companion`` until ``end``; then it sends the farewells of its ``backup`` node."""

    def __init__(self, companion: Companion, backup: BackupNode | FleetTimeBackup) -> None:
        self.name = companion.name
        self._companion, self._backup = companion, backup
        self._codec = Codec(None)
        self._ended = False
        self._next = 0

    def end(self) -> None:
        """End the companion for good."""
        self._ended = True

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Step the companion at ``now`` (µs); after its end drop the ``inbox``."""
        if not self._ended:
            return self._companion.step(now, inbox)
        if now < self._next:
            return []
        self._next = now + _FAREWELL_US
        data = b"".join(self._codec.encode(message) for message in self._backup.farewell(now))
        return [Datagram("swarm", data)] if data else []
