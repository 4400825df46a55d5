"""Backup node in a process of its own: flies a silent companion's plan to its end, then requests the hold."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Protocol

from pymavlink.dialects.v20 import all as mavlink

from companion.backup.links import LINKS, accepts, accepts_peers
from companion.flight.hold_on_exit import HoldOnExit
from companion.telemetry.reception import LINKS as COMPANION_LINKS
from mavlink_bridge.key import Key
from mavlink_bridge.messages import Heartbeat, Message
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from outrider.onboard.backup_copies import Copies, unpack
from outrider.supervision.supervised_node import SETTLING_US

DEAF_US: Final = 300_000
"""Time without a copy after which the autopilot's link is read here (µs).

Two readers of one link take each other's messages, so a short delay of the companion must not make another.
"""
_FAREWELL_US: Final = 100_000
"""Time between two announcements that the plan is the last one (µs)."""
_COPIES = "copies"


class Backup(Protocol):
    """Backup node, in fleet time or not."""

    @property
    def carried(self) -> int:
        """Number of set-points that were sent in the companion's place."""
        ...

    @property
    def steers(self) -> bool:
        """Whether the companion's last set-point agreed with its plan, and no other controller came since."""
        ...

    def farewell(self, now: int) -> list[Message]:
        """Return the newest plan, and the statement that it is the last one."""
        ...

    def hear(self, now: int, messages: Sequence[Message]) -> None:
        """Take note of the others' plans at ``now`` (µs)."""
        ...

    def rests(self, now: int, settling: int) -> bool:
        """Return whether no plan is flown, or it has been at rest for ``settling`` at ``now`` (µs)."""
        ...

    def receive(self, now: int, messages: Sequence[Message]) -> None:
        """Receive ``messages`` that were sent at ``now`` (µs)."""
        ...

    def advance(self, now: int) -> list[Datagram]:
        """Do a step at ``now`` (µs)."""
        ...


class BackupPilot:
    """``Node`` of the backup process of ``system``.

    Links: ``copies`` (records of ``backup_copies``), and the physical links ``autopilot``, to be read only
    while ``deaf``, and ``swarm``, to be read only while ``gone``; it sends on both. ``signing`` is that of
    ``backup``; ``key``: for the hold request, which has the companion's ids.

    ``gone``: set it to True when the companion's process has ended or flies no more. Then the plan is flown
    to its end at rest, the others are told that it is the last, and the hold is requested; ``over`` tells the
    end of that, ``held`` the result, None if nothing was to be done.
    """

    def __init__(
        self, system: int, backup: Backup, signing: Signing | None = None, key: Key | None = None
    ) -> None:
        self.name = f"backup-{system}"
        self.gone = self.over = False
        self.held: HoldOnExit | None = None
        self._system, self._backup, self._signing, self._key = system, backup, signing, key
        self._trusted = {link: Codec(accepts(link, system)) for link in LINKS}
        filtered = accepts("autopilot", system)
        self._read = Codec(
            lambda identifier, sender, component: (
                component == mavlink.MAV_COMP_ID_AUTOPILOT1 and filtered(identifier, sender, component)
            ),
            signing,
        )
        self._swarm = Codec(accepts_peers(system), signing, COMPANION_LINKS.index("swarm"))
        self._next_farewell = 0
        self._beat: Heartbeat | None = None
        self._beat_at = 0
        self._gone_since: int | None = None
        self._heard: int | None = None
        self._holds = False
        self.deaf = False
        """Whether the companion copies nothing, so that the autopilot's link is to be read here."""

    @property
    def carried(self) -> int:
        """Number of set-points that were sent in the companion's place."""
        return self._backup.carried

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Receive copies and messages; return what the backup node sends at ``now`` (µs)."""
        if self._signing is not None:
            self._signing.present(now)
        for link, data in inbox:
            if link == _COPIES:
                self._heard = now
                copies = unpack(data)
                self._holds = copies.holds
                self._receive(copies.time, self._copied(copies))
            elif link == "autopilot":
                self._receive(now, self._read.feed(data))
            elif link == "swarm" and self.gone:
                self._backup.hear(now, self._swarm.feed(data))
        self._heard = now if self._heard is None else self._heard
        self.deaf = self.gone or now - self._heard > DEAF_US
        if self._holds and not self.deaf:
            # Set-points beside the request for the hold could be taken for a return to the flight.
            return []
        leaving = self._backup.advance(now)
        if self.gone and not self.over:
            leaving += self._farewell(now)
            leaving += self._end(now, [datagram for datagram in inbox if datagram.link == "autopilot"])
        return leaving

    def silence(self, now: int) -> int:
        """Return the time (µs) since the last copy."""
        return 0 if self._heard is None else now - self._heard

    def _receive(self, now: int, messages: list[Message]) -> None:
        """Receive messages of the companion or its autopilot, sent at ``now`` (µs)."""
        self._backup.receive(now, messages)
        for message in messages:
            if isinstance(message, Heartbeat):
                self._beat, self._beat_at = message, now

    def _copied(self, copies: Copies) -> list[Message]:
        if self._signing is not None:
            self._signing.use(self._signing.key, copies.stamp)
        autopilot, swarm = self._trusted["autopilot"], self._trusted["swarm"]
        return [
            *autopilot.feed(copies.vehicle, whole=True),
            *swarm.feed(copies.swarm, whole=True),
            *autopilot.feed(copies.autopilot, whole=True),
        ]

    def _farewell(self, now: int) -> list[Datagram]:
        """Return the announcement that the flown plan is the last, when it is due."""
        if now < self._next_farewell:
            return []
        self._next_farewell = now + _FAREWELL_US
        data = b"".join(self._swarm.encode(message) for message in self._backup.farewell(now))
        return [Datagram("swarm", data)] if data else []

    def _end(self, now: int, heard: Sequence[Datagram]) -> list[Datagram]:
        """Return the requests for the hold, once the plan is at rest."""
        if self.held is None:
            if not self._backup.steers:
                self.over = True
                return []
            self._gone_since = now if self._gone_since is None else self._gone_since
            # A heartbeat of before may be older than the change of mode by a pilot.
            if not self._backup.rests(now, SETTLING_US) or self._beat_at < self._gone_since:
                return []
            signing = None
            if self._key is not None and self._signing is not None:
                signing = Signing(self._key)
                signing.use(self._key, self._signing.newest)
            self.held = HoldOnExit(self._system, self._beat, signing)
        requests = self.held.step(now, heard)
        self.over = self.held.over
        return requests
