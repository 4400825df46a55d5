"""Names of flight modes by their numbers in HEARTBEAT.custom_mode, as ground stations write them."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import Heartbeat

ROTORCRAFT: Final = frozenset(
    (
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_TYPE_COAXIAL,
        mavlink.MAV_TYPE_HELICOPTER,
        mavlink.MAV_TYPE_HEXAROTOR,
        mavlink.MAV_TYPE_OCTOROTOR,
        mavlink.MAV_TYPE_TRICOPTER,
        mavlink.MAV_TYPE_DODECAROTOR,
        mavlink.MAV_TYPE_DECAROTOR,
        mavlink.MAV_TYPE_GENERIC_MULTIROTOR,
    )
)
"""Values of MAV_TYPE of rotorcraft; with ArduPilot, vehicles of these types run ArduCopter."""
_PREFIX: Final = "COPTER_MODE_"
_COPTER: Final[dict[int, str]] = {
    number: entry.name.removeprefix(_PREFIX)
    for number, entry in mavlink.enums["COPTER_MODE"].items()
    if entry.name.startswith(_PREFIX) and not entry.name.endswith("ENUM_END")
}
# Main modes and their sub-modes: px4_custom_mode.h, with QGroundControl's words for those of AUTO.
_PX4: Final = {
    (1, 0): "MANUAL",
    (2, 0): "ALTCTL",
    (3, 0): "POSCTL",
    (3, 1): "POSCTL ORBIT",
    (3, 2): "POSCTL SLOW",
    (4, 1): "AUTO READY",
    (4, 2): "AUTO TAKEOFF",
    (4, 3): "AUTO HOLD",
    (4, 4): "AUTO MISSION",
    (4, 5): "AUTO RETURN",
    (4, 6): "AUTO LAND",
    (4, 8): "AUTO FOLLOW",
    (4, 9): "AUTO PRECLAND",
    (5, 0): "ACRO",
    (6, 0): "OFFBOARD",
    (7, 0): "STABILIZED",
    (8, 0): "RATTITUDE",
}


def mode_name(flavour: str, custom_mode: int) -> str:
    """Return the name of a mode of ArduCopter or PX4, or its number if it has none."""
    if flavour == "ardupilot":
        return _COPTER.get(custom_mode, str(custom_mode))
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    return _PX4.get((main, sub), f"{main}.{sub}")


def mode_of(beat: Heartbeat) -> str:
    """Return the name of the mode in an autopilot's HEARTBEAT (0), or its number if it has none."""
    if beat.autopilot == mavlink.MAV_AUTOPILOT_PX4:
        return mode_name("px4", beat.custom_mode)
    if beat.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA and beat.type in ROTORCRAFT:
        return mode_name("ardupilot", beat.custom_mode)
    # Planes, rovers and other autopilots number their modes differently.
    return str(beat.custom_mode)


def reported_mode(beat: Heartbeat) -> str:
    """Return the name of the mode in an autopilot's HEARTBEAT (0) and whether it is disarmed, for display."""
    return mode_of(beat) + ("" if is_armed(beat) else ", disarmed")


def is_armed(beat: Heartbeat) -> bool:
    """Return whether an autopilot's HEARTBEAT (0) reports it as armed."""
    return bool(beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
