"""Names of flight modes by their numbers in HEARTBEAT.custom_mode, as ground stations write them."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as dialect

from companion.flight.autopilots.ardupilot import ARDUPILOT
from companion.flight.vehicle import ARMED
from mavlink_bridge.messages import Heartbeat

_PREFIX: Final = "COPTER_MODE_"
_COPTER: Final[dict[int, str]] = {
    number: entry.name.removeprefix(_PREFIX)
    for number, entry in dialect.enums["COPTER_MODE"].items()
    if entry.name.startswith(_PREFIX) and not entry.name.endswith("ENUM_END")
}
# Main modes, and the sub-modes of the fourth, AUTO: px4_custom_mode.h.
_MAIN: Final = {
    1: "MANUAL",
    2: "ALTCTL",
    3: "POSCTL",
    4: "AUTO",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    8: "RATTITUDE",
}
_AUTO: Final = {
    1: "READY",
    2: "TAKEOFF",
    3: "HOLD",
    4: "MISSION",
    5: "RETURN",
    6: "LAND",
    8: "FOLLOW",
    9: "PRECLAND",
}


def mode_name(flavour: str, custom_mode: int) -> str:
    """Return the name of the mode, or its number if it has none."""
    if flavour == "ardupilot":
        return _COPTER.get(custom_mode, str(custom_mode))
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24
    name = _AUTO.get(sub) if main == 4 else _MAIN.get(main)
    return name or f"{main}.{sub}"


def reported_mode(beat: Heartbeat) -> str:
    """Return the name of the mode in an autopilot's HEARTBEAT (0) and whether it is disarmed, for display."""
    flavour = "ardupilot" if beat.autopilot == ARDUPILOT.autopilot else "px4"
    return mode_name(flavour, beat.custom_mode) + ("" if is_armed(beat) else ", disarmed")


def is_armed(beat: Heartbeat) -> bool:
    """Return whether an autopilot's HEARTBEAT (0) reports it as armed."""
    return bool(beat.base_mode & ARMED)
