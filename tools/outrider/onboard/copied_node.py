"""Node of the flying process that sends copies to the backup node before its messages leave."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from companion.backup.links import LINKS
from companion.node import Companion
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.messages import GpsGlobalOrigin, Heartbeat, Message, Source
from mavlink_bridge.node import Datagram, Node
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from outrider.onboard.backup_copies import Copies, CopySender

_ORIGIN_PERIOD_US: Final = 1_000_000
"""Time between two copies of the autopilot's origin (µs), for a backup node that begins in flight."""
_LATE_PERIODS: Final = 3
"""Number of set-point periods that a step may take: after four the backup node continues the plan before."""


class CopiedNode:
    """``Node`` that steps ``inner`` and sends ``copies`` of each step of its ``companion``.

    The autopilot's heartbeat and origin are copied as the companion has accepted them, so that forged ones do
    not reach the backup node. ``signing``: the companion's. ``holds`` returns whether ``inner`` has replaced
    the companion by the request for the hold. ``clock`` is that of the loop: a step that took too long by it
    sends nothing to autopilot and swarm, and its plan is recalled, because the backup node may fly the plan
    of before. ``withheld`` counts these steps.
    """

    def __init__(
        self,
        inner: Node,
        companion: Companion,
        copies: CopySender,
        clock: Clock,
        signing: Signing | None = None,
        holds: Callable[[], bool] = lambda: False,
    ) -> None:
        self._inner, self._companion = inner, companion
        self._copies, self._clock, self._signing, self._holds = copies, clock, signing, holds
        self._longest = _LATE_PERIODS * companion.config.rates.setpoint_us
        self.withheld = 0
        self._codec = Codec()
        self._beat: Heartbeat | None = None
        self._origin: tuple[float, float, float] | None = None
        self._next_origin = 0

    @property
    def name(self) -> str:
        """The companion's name."""
        return self._inner.name

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Step the node at ``now`` (µs), and copy what it is about to send."""
        leaving = self._inner.step(now, inbox)
        if self._clock.now() - now > self._longest:
            others = [datagram for datagram in leaving if datagram.link not in LINKS]
            if len(others) < len(leaving) and not self._holds() and self._companion.recall():
                self.withheld += 1
                leaving = others
        sent = dict.fromkeys(LINKS, b"")
        for link, data in leaving:
            if link in sent:
                sent[link] += data
        vehicle = b"".join(self._codec.encode(message) for message in self._heard(now))
        stamp = 0 if self._signing is None else self._signing.newest
        heard = b"".join(datagram.data for datagram in inbox if datagram.link == "swarm")
        record = Copies(now, stamp, vehicle, sent["autopilot"], sent["swarm"], heard, self._holds())
        self._copies.send(record)
        return leaving

    def _heard(self, now: int) -> list[Message]:
        """Return a new heartbeat of the autopilot, and its origin when it is new or due again."""
        found: list[Message] = []
        beat = self._companion.pilot.vehicle.heartbeat
        if beat is not None and beat is not self._beat:
            self._beat = beat
            found.append(beat)
        origin = self._companion.world.origin
        if origin is not None and (origin != self._origin or now >= self._next_origin):
            self._origin, self._next_origin = origin, now + _ORIGIN_PERIOD_US
            source = Source(self._companion.system, 1 if beat is None else beat.source.component)
            found.append(GpsGlobalOrigin(source, *origin, 0))
        return found
