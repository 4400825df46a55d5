"""SET_ATTITUDE_TARGET (82): what an attitude and a thrust ask for, as the acceleration that they mean.

The reference of the vehicle is a motion, so an attitude is flown as the motion that it leads to: its thrust
axis gives the acceleration, its yaw the heading. Air drag, which would end that motion on a real vehicle, is
left to the speed limit.
"""

from __future__ import annotations

import math
from typing import Final

from mavlink_bridge.messages import SetpointAttitude, Vector
from sitl.values.setpoints import ACCELERATION, VELOCITY, Reading, Refusal, Setpoint

GRAVITY: Final = 9.80665
HOVERING: Final = 0.5
"""The thrust at which it hovers: PX4's MPC_THR_HOVER, and the middle of ArduPilot's range of climb rates."""
STEEPEST: Final = math.radians(45.0)
"""Of the tilt that is followed."""

# ATTITUDE_TARGET_TYPEMASK
_IGNORE_YAW_RATE: Final = 0x04
_IGNORE_THRUST: Final = 0x40
_IGNORE_ATTITUDE: Final = 0x80
_UNIT: Final = (0.9, 1.1)
_QUICKEST: Final = 100.0


def climbing(message: SetpointAttitude, climb: float, sink: float) -> Reading:
    """As ArduPilot reads it: thrust is a climb rate, 0.5 for none, 1 for ``climb`` and 0 for ``sink``
    (m/s)."""
    fault = _fault(message)
    if fault is not None:
        return fault
    up, yaw = _thrust_axis(message), _yaw(message)
    share = 2.0 * (message.thrust - HOVERING)
    rate = share * (climb if share > 0.0 else sink)
    # Thrust is raised in a turn so that the height stays.
    lean = GRAVITY / up[2]
    return Setpoint(
        (ACCELERATION, ACCELERATION, VELOCITY),
        velocity=(0.0, 0.0, -rate),
        acceleration=(lean * up[0], lean * up[1], 0.0),
        yaw=yaw,
        yaw_rate=_yaw_rate(message),
    )


def thrusting(message: SetpointAttitude) -> Reading:
    """As PX4 reads it: thrust is thrust, 0.5 that of hovering."""
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
    if message.type_mask & _IGNORE_ATTITUDE:
        return Refusal("Attitude refused: body rates alone are not flown")
    if message.type_mask & _IGNORE_THRUST or not 0.0 <= message.thrust <= 1.0:
        return Refusal("Attitude refused: no thrust from 0 to 1")
    if not _UNIT[0] <= math.hypot(*message.attitude) <= _UNIT[1]:
        return Refusal("Attitude refused: not a unit quaternion")
    if not message.type_mask & _IGNORE_YAW_RATE and not abs(message.body_rates[2]) <= _QUICKEST:
        return Refusal("Attitude refused: yaw rate out of range")
    return None


def _thrust_axis(message: SetpointAttitude) -> Vector:
    """Where thrust points: north, east, *up*; of unit length, no further from up than ``STEEPEST``."""
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
    """rad, clockwise from north."""
    w, x, y, z = message.attitude
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def _yaw_rate(message: SetpointAttitude) -> float | None:
    return None if message.type_mask & _IGNORE_YAW_RATE else message.body_rates[2]
