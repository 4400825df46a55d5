"""Shadow companion on a live link: it requests the messages that it needs, and commands nothing.

It sends heartbeats, requests for messages, parameters and the time, and status texts. Its component id is not
the companion's, because the companion may be on the link as well. It answers no orders.
"""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
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

ONLOOKER: Final[int] = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER4
"""Component id of the shadow companion."""
REQUESTS = (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE)
"""Commands that may be sent, because they do not change the vehicle's behaviour."""


class _RequestingOnlooker(Onlooker):
    """Onlooker that sends requests. ``lacking``: missing input that would delay a take-off, or ""."""

    lacking = ""

    def __init__(self, config: CompanionConfig, own: Source, origin_altitude: float) -> None:
        # With its own component id the answers do not mix with those to the companion's requests.
        super().__init__(config, own._replace(component=ONLOOKER), origin_altitude)

    def step(self, now: int, view: View) -> list[Message]:
        """Update the phase; return nothing but requests for messages and parameters."""
        super().step(now, view)
        self.lacking = self._readiness.missing(view, go=self._height is not None)
        wishes = self._readiness.wishes(now) if self._readiness.received else []
        return [*self._readiness.requests(now), *wishes]


class DryRun(ShadowCompanion):
    """Companion that sends nothing that would change what the vehicle or another node does."""

    pilot: _RequestingOnlooker
    pilots = _RequestingOnlooker

    def _encode(self, **links: list[Message]) -> list[Datagram]:
        super()._encode(**links)
        own = Source(self.system, ONLOOKER)
        permitted: dict[str, list[Message]] = {
            link: [m._replace(source=own) for m in messages if _changes_nothing(m)]
            for link, messages in links.items()
        }
        return Companion._encode(self, **permitted)


def _changes_nothing(message: Message) -> bool:
    if isinstance(message, CommandLong):
        return message.command in REQUESTS
    return isinstance(message, Heartbeat | StatusText | Timesync | ParamRequestRead)
