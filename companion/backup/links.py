"""Links of the backup node: whose messages it receives on each."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from companion.values.components import COMPONENT
from mavlink_bridge.wire.codec import Accept

BACKUP: Final[int] = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
"""Component id of the backup node."""
LINKS: Final = ("autopilot", "swarm")
"""The links of a backup node."""
_AUTOPILOT_IDS = frozenset((mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN))
_COMPANION_IDS = frozenset(
    (mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED, mavlink.MAVLINK_MSG_ID_COMMAND_LONG)
)
"""Message ids that are received on the autopilot's link, by sender."""


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
