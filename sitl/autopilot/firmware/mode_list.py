"""Flight modes that a firmware lists in AVAILABLE_MODES (435): those that are emulated."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import AvailableMode, Source
from sitl.autopilot.firmware import Firmware, Mode

_STANDARD: Final = {
    Mode.POSITION: mavlink.MAV_STANDARD_MODE_POSITION_HOLD,
    Mode.MISSION: mavlink.MAV_STANDARD_MODE_MISSION,
    Mode.RETURN: mavlink.MAV_STANDARD_MODE_SAFE_RECOVERY,
    Mode.LAND: mavlink.MAV_STANDARD_MODE_LAND,
    Mode.TAKEOFF: mavlink.MAV_STANDARD_MODE_TAKEOFF,
}
_ARDUPILOT: Final = {
    Mode.STANDBY: "STABILIZE",
    Mode.MISSION: "AUTO",
    Mode.GUIDED: "GUIDED",
    Mode.POSITION: "LOITER",
    Mode.RETURN: "RTL",
    Mode.LAND: "LAND",
    Mode.HOLD: "BRAKE",
    Mode.FOLLOW: "FOLLOW",
}
_PX4: Final = {
    Mode.POSITION: "Position",
    Mode.HOLD: "Hold",
    Mode.GUIDED: "Offboard",
    Mode.TAKEOFF: "Takeoff",
    Mode.LAND: "Land",
    Mode.MISSION: "Mission",
    Mode.RETURN: "Return",
    Mode.FOLLOW: "Follow Target",
}


def standard_mode(firmware: Firmware, mode: Mode) -> int:
    """Return the MAV_STANDARD_MODE of ``mode``."""
    # ArduPilot's take-off is a part of GUIDED.
    known = _STANDARD.get(mode, mavlink.MAV_STANDARD_MODE_NON_STANDARD)
    return known if firmware.bytewise or mode is not Mode.TAKEOFF else 0


def available_modes(source: Source, firmware: Firmware) -> list[AvailableMode]:
    """Return all modes, in the order of their index."""
    names = _PX4 if firmware.bytewise else _ARDUPILOT
    return [
        AvailableMode(
            source, firmware.custom_mode(mode), 0, len(names), index, standard_mode(firmware, mode), name
        )
        for index, (mode, name) in enumerate(names.items(), 1)
    ]
