"""An understudy on a live link: it asks for the messages that it needs, and orders nothing.

What leaves it: heartbeats, requests for messages, parameters and the time, and texts; not as the companion,
which may be there as well. It answers no order.
"""

from __future__ import annotations

from companion.config import CompanionConfig
from companion.flight.readiness import REQUEST_MESSAGE, SET_MESSAGE_INTERVAL
from companion.node import Companion
from companion.shadow import Onlooker, ShadowCompanion
from companion.world import View
from mavlink_bridge.messages import (
    CommandLong,
    Heartbeat,
    Message,
    ParamRequestRead,
    Source,
    StatusText,
    Timesync,
)
from mavlink_bridge.node import Datagram

ONLOOKER = 194
"""MAV_COMP_ID_ONBOARD_COMPUTER4."""
REQUESTS = (SET_MESSAGE_INTERVAL, REQUEST_MESSAGE)
"""Commands that change nothing of what a vehicle does."""


class _Asking(Onlooker):
    """``lacking``: what a flight would wait for before it takes off."""

    lacking = ""

    def __init__(self, config: CompanionConfig, own: Source, origin_altitude: float) -> None:
        # Whom the answers are to: the companion may ask as well.
        super().__init__(config, own._replace(component=ONLOOKER), origin_altitude)

    def step(self, now: int, view: View) -> list[Message]:
        """Requests for messages and parameters alone."""
        super().step(now, view)
        self.lacking = self._readiness.missing(view, go=self._height is not None)
        wishes = self._readiness.wishes(now) if self._readiness.heard else []
        return [*self._readiness.requests(now), *wishes]


class DryRun(ShadowCompanion):
    """As ``Companion``; nothing leaves it that would change what the vehicle or anybody else does."""

    pilot: _Asking
    pilots = _Asking

    def _encode(self, **links: list[Message]) -> list[Datagram]:
        super()._encode(**links)
        own = Source(self.system, ONLOOKER)
        told: dict[str, list[Message]] = {
            link: [m._replace(source=own) for m in messages if _changes_nothing(m)]
            for link, messages in links.items()
        }
        return Companion._encode(self, **told)


def _changes_nothing(message: Message) -> bool:
    if isinstance(message, CommandLong):
        return message.command in REQUESTS
    return isinstance(message, Heartbeat | StatusText | Timesync | ParamRequestRead)
