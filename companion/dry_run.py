"""Shadow companion on a live link: it requests the messages that it needs, and commands nothing.

It sends heartbeats, requests for messages, parameters and the time, and status texts. Its component id is not
the companion's, because the companion may be on the link as well. It answers no orders.
"""

from __future__ import annotations

from collections.abc import Set
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.node import Companion
from companion.shadow import Onlooker, ShadowCompanion
from companion.world import View
from mavlink_bridge.messages import (
    BY_ID,
    BY_TYPE,
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
_SILENT_US = 3_000_000
"""Time (µs) without a message after which it is requested: ground stations let none come less often."""


class _RequestingOnlooker(Onlooker):
    """Onlooker that sends requests. ``lacking``: missing input that would delay a take-off, or "".

    The link may be a radio, or that of a companion in flight: a message that arrives is not requested, and
    the others are requested at low rates.
    """

    lacking = ""

    def __init__(self, config: CompanionConfig, own: Source, origin_altitude: float) -> None:
        # With its own component id the answers do not mix with those to the companion's requests.
        super().__init__(config, own._replace(component=ONLOOKER), origin_altitude, slow=True)
        self._began: int | None = None
        self._received: set[int] = set()
        self._arrived: dict[int, int] = {}

    def receive(self, message: Message) -> None:
        """Receive a message of the own autopilot."""
        self._received.add(BY_TYPE[type(message)].id)
        super().receive(message)

    def step(self, now: int, view: View) -> list[Message]:
        """Update the phase; return nothing but requests for messages and parameters."""
        super().step(now, view)
        self._readiness.arriving = self._arriving(now)
        self.lacking = self._readiness.missing(view, go=self._go.height is not None)
        wishes = self._readiness.wishes(now) if self._readiness.received else []
        return [*self._readiness.requests(now), *wishes]

    def _arriving(self, now: int) -> Set[int]:
        """Return the ids of the messages that arrive, which in the first seconds may be any."""
        self._arrived |= dict.fromkeys(self._received, now)
        self._received.clear()
        self._began = now if self._began is None else self._began
        if now - self._began <= _SILENT_US:
            return frozenset(BY_ID)
        return {number for number, at in self._arrived.items() if now - at <= _SILENT_US}


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
