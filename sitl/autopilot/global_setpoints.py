"""Conversion of SET_POSITION_TARGET_GLOBAL_INT (86) to a set-point in the vehicle's own local NED."""

from __future__ import annotations

from typing import Final

from mavlink_bridge.messages import SetpointGlobal, SetpointLocal, Vector
from sitl.values.home import Home
from sitl.values.origin import Origin
from sitl.values.setpoints import IGNORE_POSITION, LOCAL_NED, ZERO, Reading, Refusal, Stop

# MAV_FRAME with and without _INT: above mean sea level, above home. Frames above terrain are not supported,
# because there is no terrain.
_ABOVE_SEA: Final = (0, 5)
_ABOVE_HOME: Final = (3, 6)
_POLE, _DATE_LINE = 900_000_000, 1_800_000_000


def localised(message: SetpointGlobal, origin: Origin, home: Home, *, stops: bool) -> SetpointLocal | Reading:
    """Return ``message`` as SET_POSITION_TARGET_LOCAL_NED (84) in frame 1, or the reason against it.

    ``stops``: an unknown frame means *stop*, as for ArduPilot; else the set-point is refused, as PX4 does.
    Without a position the frame does not matter: velocities are along north, east and down.
    """
    position = ZERO
    if message.type_mask & IGNORE_POSITION != IGNORE_POSITION:
        if message.frame not in _ABOVE_SEA + _ABOVE_HOME:
            reason = f"frame {message.frame}"
            return Stop(f"Set-point stops: {reason}") if stops else Refusal(f"Set-point refused: {reason}")
        if abs(message.x) > _POLE or abs(message.y) > _DATE_LINE:
            return Refusal("Set-point refused: no such place on the globe")
        position = _position(message, origin, home)
    return SetpointLocal(
        message.source,
        message.time_boot,
        message.target_system,
        message.target_component,
        LOCAL_NED,
        message.type_mask,
        position,
        message.velocity,
        message.acceleration,
        message.yaw,
        message.yaw_rate,
    )


def _position(message: SetpointGlobal, origin: Origin, home: Home) -> Vector:
    """Return the position (m, local NED). A NaN altitude stays NaN; the set-point's check finds it."""
    above = home.altitude if message.frame in _ABOVE_HOME else 0.0
    x, y, z = origin.local(message.x / 1e7, message.y / 1e7, origin.altitude)
    # The Earth's curvature: at equal altitude z is not zero.
    return x, y, z - (message.altitude + above - origin.altitude)
