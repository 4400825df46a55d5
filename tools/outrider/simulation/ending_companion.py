"""Companion in lock-step whose process may end, what is sent in its place, and its successor.

In ``outrider fly`` the process of the backup node knows that the companion's process has ended, and tells the
others that the plan it flies is the last one. Here the same is sent from the companion's end of the link.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from companion.backup.links import accepts_peers
from companion.backup_node import BackupNode
from companion.fleet_time_backup import FleetTimeBackup
from companion.node import Companion
from companion.planning.avoidance import Tally
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec

_FAREWELL_US: Final = 100_000
"""Time between two announcements that the plan is the last one (µs)."""


class EndingCompanion:
    """Node of the companion that ``make`` returns, until ``end``, and of another one from ``restart`` on.

    In between it sends the farewells of the ``backup`` node, if there is one. ``companion``: the present one,
    or the last.
    """

    def __init__(
        self, make: Callable[[], Companion], backup: BackupNode | FleetTimeBackup | None = None
    ) -> None:
        self._make, self._backup = make, backup
        self.companion = make()
        self.name = self.companion.name
        self._codec = Codec(accepts_peers(self.companion.system))
        self._before: Tally | None = None
        self._ended = False
        self._next = 0

    @property
    def tally(self) -> Tally:
        """Counters of all companions until now."""
        now, before = self.companion.tally, self._before
        if before is None:
            return now
        return Tally(
            before.plans + now.plans,
            before.relaxed + now.relaxed,
            before.solver_failures + now.solver_failures,
            before.held + now.held,
            before.anchored_anew + now.anchored_anew,
            [*before.plan_ns, *now.plan_ns],
            [*before.plan_at, *now.plan_at],
            left_tube=before.left_tube + now.left_tube,
        )

    @property
    def has_backup(self) -> bool:
        """Whether a backup node sends in place of the companion after its end."""
        return self._backup is not None

    def end(self) -> None:
        """End the companion."""
        self._ended = True

    def restart(self) -> Companion:
        """Begin with another companion, which knows nothing of the flight, and return it."""
        self._before = self.tally
        self._ended, self.companion = False, self._make()
        return self.companion

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Step the companion at ``now`` (µs); after its end the backup node hears the others' plans."""
        if not self._ended:
            return self.companion.step(now, inbox)
        if self._backup is None:
            return []
        self._backup.hear(now, [m for link, data in inbox if link == "swarm" for m in self._codec.feed(data)])
        if now < self._next:
            return []
        self._next = now + _FAREWELL_US
        data = b"".join(self._codec.encode(message) for message in self._backup.farewell(now))
        return [Datagram("swarm", data)] if data else []
