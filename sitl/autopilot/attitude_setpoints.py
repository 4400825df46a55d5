"""Conversion of SET_ATTITUDE_TARGET (82): attitude and thrust become the acceleration that they imply.

The vehicle's reference is a motion, so an attitude is flown as the motion that results from it: its thrust
axis gives the acceleration, its yaw the heading. Air drag, which would end that motion on a real vehicle, is
not modelled here; the speed limit bounds the motion instead.
"""

from __future__ import annotations

import math
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import SetpointAttitude, Vector
from sitl.values.setpoints import ACCELERATION, VELOCITY, Reading, Refusal, Setpoint

GRAVITY: Final = 9.80665
HOVERING: Final = 0.5
"""Thrust value of hovering: PX4's MPC_THR_HOVER, and the middle of ArduPilot's range of climb rates."""
STEEPEST: Final = math.radians(45.0)
"""Largest tilt that is followed (rad)."""

# Accepted norms of the quaternion, and the largest accepted yaw rate (rad/s).
_NORM_RANGE: Final = (0.9, 1.1)
_MAX_YAW_RATE: Final = 100.0


def climbing(message: SetpointAttitude, climb: float, sink: float) -> Reading:
    """Read the message as ArduPilot does, with thrust as a climb rate.

    Thrust 0.5 means no climb, 1 means ``climb`` and 0 means ``sink`` (m/s).
    """
    fault = _fault(message)
    if fault is not None:
        return fault
    up, yaw = _thrust_axis(message), _yaw(message)
    share = 2.0 * (message.thrust - HOVERING)
    rate = share * (climb if share > 0.0 else sink)
    # Thrust is raised while tilted, so that the height stays.
    lean = GRAVITY / up[2]
    return Setpoint(
        (ACCELERATION, ACCELERATION, VELOCITY),
        velocity=(0.0, 0.0, -rate),
        acceleration=(lean * up[0], lean * up[1], 0.0),
        yaw=yaw,
        yaw_rate=_yaw_rate(message),
    )


def thrusting(message: SetpointAttitude) -> Reading:
    """Read the message as PX4 does: the force is proportional to the thrust value, 0.5 for hovering."""
    fault = _fault(message)
    if fault is not None:
        return fault
    north, east, up = _thrust_axis(message)
    push = GRAVITY * message.thrust / HOVERING
    return Setpoint(
        (ACCELERATION, ACCELERATION, ACCELERATION),
        acceleration=(push * north, push * east, GRAVITY - push * up),
        yaw=_yaw(message),
        yaw_rate=_yaw_rate(message),
    )


def _fault(message: SetpointAttitude) -> Refusal | None:
    mask, yaw_rate = message.type_mask, _yaw_rate(message)
    if mask & mavlink.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE:
        return Refusal("Attitude refused: body rates alone are not flown")
    if mask & mavlink.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE or not 0.0 <= message.thrust <= 1.0:
        return Refusal("Attitude refused: no thrust from 0 to 1")
    if not _NORM_RANGE[0] <= math.hypot(*message.attitude) <= _NORM_RANGE[1]:
        return Refusal("Attitude refused: not a unit quaternion")
    if yaw_rate is not None and not abs(yaw_rate) <= _MAX_YAW_RATE:
        return Refusal("Attitude refused: yaw rate out of range")
    return None


def _thrust_axis(message: SetpointAttitude) -> Vector:
    """Return the unit thrust axis (north, east, *up*), tilted by at most ``STEEPEST``."""
    w, x, y, z = message.attitude
    scale = 2.0 / (w * w + x * x + y * y + z * z)
    north, east = -scale * (w * y + x * z), scale * (w * x - y * z)
    up = 1.0 - scale * (x * x + y * y)
    tilt = math.atan2(math.hypot(north, east), up)
    if tilt <= STEEPEST:
        return north, east, up
    bearing = math.atan2(east, north)
    level, rise = math.sin(STEEPEST), math.cos(STEEPEST)
    return level * math.cos(bearing), level * math.sin(bearing), rise


def _yaw(message: SetpointAttitude) -> float:
    """Return the yaw (rad, clockwise from north)."""
    w, x, y, z = message.attitude
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def _yaw_rate(message: SetpointAttitude) -> float | None:
    ignored = message.type_mask & mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE
    return None if ignored else message.body_rates[2]
