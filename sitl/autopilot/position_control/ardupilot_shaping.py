"""Desired trajectory of ArduCopter's GUIDED mode: it approaches set-points within limits.

Each set-point is extrapolated with its own acceleration. The desired trajectory approaches it with a velocity
that closes the position error by the square-root law, an acceleration that closes the velocity error, and the
set-point's own velocity and acceleration on top. The corrections are limited to WPNAV_SPEED and WPNAV_ACCEL
(vertically WPNAV_SPEED_UP, WPNAV_SPEED_DN and WPNAV_ACCEL_Z), the set-point's own part is not; but the
*change* of the desired acceleration is limited by PSC_JERK_XY (vertically PSC_JERK_Z). So a stream of
set-points with less jerk passes unchanged, and a stream that reverses its acceleration is followed late.
"""

from __future__ import annotations

import math
from typing import Final

from mavlink_bridge.messages import Vector
from sitl.autopilot.position_control.airframe import Motion
from sitl.autopilot.position_control.square_root import (
    Pair,
    cut,
    directed,
    joined,
    same_way,
    split,
    square_root_law,
)
from sitl.config.gains import ArduPilotGains, Speeds
from sitl.values.setpoints import ZERO

_OVERSPEED: Final = 2.0
"""Factor of the vertical limits of acceleration and jerk while the vertical speed limit is exceeded.

The limits are multiplied by this factor times the ratio of the desired vertical speed to its limit.
"""
_MAX_CROSS_SHARE: Final = math.sqrt(0.5)
"""Greatest part of a correcting acceleration across the wanted velocity, over the limit of the correction.

It applies to corrections that are mostly along the wanted velocity.
"""
_NONE: Final = (0.0, 0.0)


class Shaping:
    """Desired trajectory: ``position``, ``velocity``, ``acceleration``, local NED."""

    def __init__(self, gains: ArduPilotGains, speeds: Speeds) -> None:
        self.configure(gains, speeds)
        self.restart(ZERO, ZERO, ZERO)

    def configure(self, gains: ArduPilotGains, speeds: Speeds) -> None:
        """Use new parameters from now on."""
        self._gains = gains
        self._speeds = speeds

    def restart(self, position: Vector, velocity: Vector, acceleration: Vector) -> None:
        """Continue from this motion."""
        self.position, self.velocity, self.acceleration = position, velocity, acceleration

    def advance(self, wanted: Motion, dt: float, limited: Pair, error: Pair, velocity_error: Pair) -> None:
        """Advance by ``dt`` seconds towards ``wanted``, which is valid at the end of the step.

        ``limited`` (m/s²): acceleration that exceeds the lean limit, or zero if the limit is not reached.
        ``error`` (m) and ``velocity_error`` (m/s): desired minus actual position and velocity. The desired
        horizontal position does not move while its motion and ``error`` both have a component along
        ``limited``. The desired horizontal velocity does not change while its change and ``velocity_error``
        both have one, except to brake a velocity against ``limited``.
        """
        self._move(dt, limited, error, velocity_error)
        (x, y, z), (u, v, w), (a, b, c) = wanted
        north, east = self._horizontal((x, y), (u, v), (a, b), dt)
        self.acceleration = (north, east, self._vertical(z, w, c, dt))

    def _move(self, dt: float, limited: Pair, error: Pair, velocity_error: Pair) -> None:
        (x, y, z), (u, v, w), (a, b, c) = self.position, self.velocity, self.acceleration
        half = 0.5 * dt * dt
        way = u * dt + a * half, v * dt + b * half
        change = a * dt, b * dt
        if limited != _NONE:
            if same_way(way, limited) and same_way(error, limited):
                way = _NONE
            if (
                same_way(change, limited)
                and same_way(velocity_error, limited)
                and not same_way((-u, -v), limited)
            ):
                change = _NONE
        self.position = (x + way[0], y + way[1], z + w * dt + c * half)
        self.velocity = (u + change[0], v + change[1], w + c * dt)

    def _horizontal(self, place: Pair, velocity: Pair, acceleration: Pair, dt: float) -> Pair:
        gains = self._gains
        limit, jerk = gains.acceleration, gains.jerk
        error = place[0] - self.position[0], place[1] - self.position[1]
        closing = cut(directed(error, 0.5 * jerk / limit, 0.5 * limit, dt), self._speeds.level)
        aim = closing[0] + velocity[0], closing[1] + velocity[1]
        velocity_error = aim[0] - self.velocity[0], aim[1] - self.velocity[1]
        correction = _corrected(directed(velocity_error, jerk / limit, jerk, dt), aim, limit)
        now = self.acceleration[:2]
        change = correction[0] + acceleration[0] - now[0], correction[1] + acceleration[1] - now[1]
        change = cut(change, jerk * dt)
        return now[0] + change[0], now[1] + change[1]

    def _vertical(self, place: float, velocity: float, acceleration: float, dt: float) -> float:
        gains, speeds, fast = self._gains, self._speeds, self.velocity[2]
        gain = 1.0
        if fast > speeds.down:
            gain = _OVERSPEED * fast / speeds.down
        elif fast < -speeds.up:
            gain = -_OVERSPEED * fast / speeds.up
        limit, jerk = gains.acceleration_z * gain, gains.jerk_z * gain
        aim = square_root_law(place - self.position[2], 0.5 * jerk / limit, 0.5 * limit, dt)
        aim = max(-speeds.up, min(speeds.down, aim)) + velocity
        correction = square_root_law(aim - fast, jerk / limit, jerk, dt)
        correction = max(-limit, min(limit, correction)) + acceleration
        change = correction - self.acceleration[2]
        return self.acceleration[2] + max(-jerk * dt, min(jerk * dt, change))


def _corrected(correction: Pair, aim: Pair, limit: float) -> Pair:
    """Limit a correcting acceleration to ``limit``.

    If it is mostly along the wanted velocity ``aim``, the part across has priority, up to √½ of ``limit``.
    """
    along, across, direction = split(correction, aim)
    if direction == _NONE or along * along <= across[0] ** 2 + across[1] ** 2:
        return cut(correction, limit)
    across = cut(across, _MAX_CROSS_SHARE * limit)
    room = math.sqrt(max(limit * limit - across[0] ** 2 - across[1] ** 2, 0.0))
    return joined(max(-room, min(room, along)), across, direction)
