"""Links of the backup node: whose messages it receives on each, and their codecs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from companion.values.components import COMPONENT
from mavlink_bridge.messages import Message
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Accept, Codec
from mavlink_bridge.wire.signing import Signing

BACKUP: Final[int] = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
"""Component id of the backup node."""
LINKS: Final = ("autopilot", "swarm")
"""The links of a backup node."""
_AUTOPILOT_IDS = frozenset((mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN))
_COMPANION_IDS = frozenset(
    (mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED, mavlink.MAVLINK_MSG_ID_COMMAND_LONG)
)
"""Message ids that are received on the autopilot's link, by sender."""


class Links:
    """Codecs of the links of the backup node of ``system``, which check and sign with ``signing``."""

    def __init__(self, system: int, signing: Signing | None) -> None:
        self._signing = signing
        self._codecs = {link: Codec(accepts(link, system), signing) for link in LINKS}

    def decode(self, now: int, inbox: Sequence[Datagram]) -> list[Message]:
        """Return the messages that ``accepts`` accepts; from ``now`` (µs) on signatures have this time."""
        if self._signing is not None:
            self._signing.present(now)
        return [message for link, data in inbox for message in self._codecs[link].feed(data, whole=True)]

    def encode(self, link: str, message: Message) -> Datagram:
        """Return the datagram of a ``message`` for ``link``."""
        return Datagram(link, self._codecs[link].encode(message))


def accepts(link: str, system: int) -> Accept:
    """Return the header filter of ``link`` for the backup node of ``system``."""
    if link == "swarm":
        return lambda identifier, sender, component: (
            (sender, component) == (system, COMPONENT) and identifier == mavlink.MAVLINK_MSG_ID_TUNNEL
        )
    return lambda identifier, sender, component: (
        sender == system
        and (
            (component == mavlink.MAV_COMP_ID_AUTOPILOT1 and identifier in _AUTOPILOT_IDS)
            or (component == COMPONENT and identifier in _COMPANION_IDS)
        )
    )


def accepts_peers(system: int) -> Accept:
    """Return the header filter of the swarm link for ``BackupNode.hear`` of ``system``."""
    return lambda identifier, sender, component: (
        identifier == mavlink.MAVLINK_MSG_ID_TUNNEL and sender != system and component == COMPONENT
    )
