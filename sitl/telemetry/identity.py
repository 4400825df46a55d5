"""Answer to a request for AUTOPILOT_VERSION (148).

The versions are those recorded of the emulated firmware; capabilities that are not emulated are left out.
"""

from __future__ import annotations

from typing import Final

from mavlink_bridge.messages import AutopilotVersion, Source

# MAV_PROTOCOL_CAPABILITY: missions as float and int, parameters, COMMAND_INT, set-points as attitude, in
# local NED and on the globe, MAVLink 2, flight termination, fence, rally points. Files, terrain and compass
# calibration are not supported.
_BOTH: Final = 0x1 | 0x2 | 0x4 | 0x8 | 0x40 | 0x80 | 0x100 | 0x800 | 0x2000 | 0x4000 | 0x8000
_BYTEWISE: Final = 0x10

# Four bytes: major, minor, patch, and 255 for an official release. ArduCopter 4.6.3, PX4 1.16.1.
_VERSIONS: Final = {"ardupilot": 0x040603FF, "px4": 0x011001FF}
_NAME: Final = b"outrider"


def version(source: Source, flavour: str) -> AutopilotVersion:
    """Return AUTOPILOT_VERSION (148) of ``flavour``.

    The uid contains the system id, so that each vehicle has its own; the eight bytes of the version control
    hash are our name.
    """
    capabilities = _BOTH | (_BYTEWISE if flavour == "px4" else 0)
    uid = int.from_bytes(_NAME[:7] + bytes((source.system,)), "big")
    uid2 = (_NAME + bytes((source.system,))).ljust(18, b"\0")
    number = _VERSIONS[flavour]
    return AutopilotVersion(source, capabilities, uid, number, 0, 0, 0, 0, 0, _NAME, bytes(8), bytes(8), uid2)
