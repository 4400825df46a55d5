"""Velocity at a waypoint that a mission flies through."""

from __future__ import annotations

import math
from typing import Final

from mavlink_bridge.messages import Vector
from sitl.config.autopilot import AutopilotConfig
from sitl.values.setpoints import ZERO

# A sharper turn (rad) is flown as a stop at the waypoint's radius, so that missions keep to their legs.
_STRAIGHT: Final = math.radians(30.0)
# Share of the acceleration with which the approach brakes, as in ``Shaper``.
_BRAKING: Final = 0.6


def passing(
    begin: Vector, corner: Vector, end: Vector | None, speed: float, config: AutopilotConfig
) -> Vector:
    """Return the velocity (m/s, local NED) at ``corner`` on the way from ``begin`` to ``end``.

    Both firmwares keep their speed on a straight way. It is at most ``speed``; that of the circle which
    touches both legs at the acceptance radius, as in PX4; and that from which the vehicle stops at ``end``.
    Zero if nothing follows (``end`` is None), or the way turns by more than 30°.
    """
    if end is None:
        return ZERO
    x, y, z = (b - a for a, b in zip(begin, corner, strict=True))
    u, v, w = (b - a for a, b in zip(corner, end, strict=True))
    length, after = math.hypot(x, y, z), math.hypot(u, v, w)
    if length < config.acceptance_radius or after == 0.0:
        return ZERO
    turn = math.acos(max(-1.0, min(1.0, (x * u + y * v + z * w) / (length * after))))
    if turn > _STRAIGHT:
        return ZERO
    acceleration = config.gentle_acceleration
    half = math.tan(turn / 2.0)
    circle = math.sqrt(acceleration * config.acceptance_radius / half) if half else math.inf
    stop = math.sqrt(2.0 * _BRAKING * acceleration * after)
    share = min(speed, circle, stop) / length
    return x * share, y * share, z * share
