"""Desired trajectory of ArduCopter's GUIDED mode: it approaches set-points within limits.

Each set-point is extrapolated with its own acceleration. The desired trajectory approaches it with a velocity
that closes the position error by the square-root law, an acceleration that closes the velocity error, and the
set-point's own velocity and acceleration on top. The corrections are limited to WPNAV_SPEED and WPNAV_ACCEL,
the set-point's own part is not; but the *change* of the desired acceleration is limited by PSC_JERK_XY. So a
stream with less jerk passes unchanged, and one that reverses its acceleration is followed late.
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
"""Gain with which vertical limits grow when the vertical speed limits are exceeded."""
_CORNER: Final = math.sqrt(0.5)
"""Share of the correction that may be across the wanted velocity, if most of it is along that velocity."""
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

    def advance(self, wanted: Motion, dt: float, limited: Pair, error: Pair, slip: Pair) -> None:
        """Advance by ``dt`` seconds towards ``wanted``, which is valid at their end.

        ``limited``: the direction in which the lean angle is at its limit, zero if it is not; the trajectory
        then does not run further away from a vehicle whose position ``error`` (m) and velocity error ``slip``
        (m/s) point in that direction.
        """
        self._move(dt, limited, error, slip)
        (x, y, z), (u, v, w), (a, b, c) = wanted
        north, east = self._level((x, y), (u, v), (a, b), dt)
        self.acceleration = (north, east, self._vertical(z, w, c, dt))

    def _move(self, dt: float, limited: Pair, error: Pair, slip: Pair) -> None:
        (x, y, z), (u, v, w), (a, b, c) = self.position, self.velocity, self.acceleration
        half = 0.5 * dt * dt
        way = u * dt + a * half, v * dt + b * half
        change = a * dt, b * dt
        if limited != _NONE:
            if same_way(way, limited) and same_way(error, limited):
                way = _NONE
            if same_way(change, limited) and same_way(slip, limited) and not same_way((-u, -v), limited):
                change = _NONE
        self.position = (x + way[0], y + way[1], z + w * dt + c * half)
        self.velocity = (u + change[0], v + change[1], w + c * dt)

    def _level(self, place: Pair, velocity: Pair, acceleration: Pair, dt: float) -> Pair:
        gains = self._gains
        most, jerk = gains.acceleration, gains.jerk
        error = place[0] - self.position[0], place[1] - self.position[1]
        closing = cut(directed(error, 0.5 * jerk / most, 0.5 * most, dt), self._speeds.level)
        aim = closing[0] + velocity[0], closing[1] + velocity[1]
        slip = aim[0] - self.velocity[0], aim[1] - self.velocity[1]
        push = _corrected(directed(slip, jerk / most, jerk, dt), aim, most)
        now = self.acceleration[:2]
        change = push[0] + acceleration[0] - now[0], push[1] + acceleration[1] - now[1]
        change = cut(change, jerk * dt)
        return now[0] + change[0], now[1] + change[1]

    def _vertical(self, place: float, velocity: float, acceleration: float, dt: float) -> float:
        gains, speeds, fast = self._gains, self._speeds, self.velocity[2]
        gain = 1.0
        if fast > speeds.down:
            gain = _OVERSPEED * fast / speeds.down
        elif fast < -speeds.up:
            gain = -_OVERSPEED * fast / speeds.up
        most, jerk = gains.acceleration_z * gain, gains.jerk_z * gain
        aim = square_root_law(place - self.position[2], 0.5 * jerk / most, 0.5 * most, dt)
        aim = max(-speeds.up, min(speeds.down, aim)) + velocity
        push = square_root_law(aim - fast, jerk / most, jerk, dt)
        push = max(-most, min(most, push)) + acceleration
        change = push - self.acceleration[2]
        return self.acceleration[2] + max(-jerk * dt, min(jerk * dt, change))


def _corrected(push: Pair, aim: Pair, most: float) -> Pair:
    """Limit a correcting acceleration to ``most``.

    The part across the wanted velocity ``aim`` keeps its share.
    """
    along, across, direction = split(push, aim)
    if direction == _NONE or along * along <= across[0] ** 2 + across[1] ** 2:
        return cut(push, most)
    across = cut(across, _CORNER * most)
    room = math.sqrt(max(most * most - across[0] ** 2 - across[1] ** 2, 0.0))
    return joined(max(-room, min(room, along)), across, direction)
