"""ArduCopter 4.6's GUIDED position controller: desired trajectory → position → velocity → lean angle."""

from __future__ import annotations

import math
from typing import Self

from mavlink_bridge.messages import Vector
from sitl.autopilot.position_control.airframe import ARDUPILOT, GRAVITY, Motion, PointMass
from sitl.autopilot.position_control.ardupilot_shaping import Shaping
from sitl.autopilot.position_control.square_root import (
    Pair,
    cut,
    directed,
    inverse_square_root_law,
    joined,
    same_way,
    split,
    square_root_law,
)
from sitl.config.autopilot import AutopilotConfig
from sitl.config.gains import ArduPilotGains, Speeds
from sitl.values.setpoints import ZERO


class ArduPilotResponse:
    """Response of an ArduCopter to set-points.

    ``motion`` is the vehicle's motion, ``desired`` that of the trajectory that approaches the set-points;
    local NED.
    """

    def __init__(self, gains: ArduPilotGains, speeds: Speeds) -> None:
        self._gains = gains
        self._speeds = speeds
        self._mass = PointMass(ARDUPILOT)
        self._shaping = Shaping(gains, speeds)
        self.restart(ZERO)

    @classmethod
    def of(cls, config: AutopilotConfig) -> Self:
        """Return the response of an autopilot with these settings."""
        return cls(config.ardupilot, _speeds(config))

    def configure(self, config: AutopilotConfig) -> None:
        """Use new parameters from now on."""
        self._gains = config.ardupilot
        self._speeds = _speeds(config)
        self._shaping.configure(self._gains, self._speeds)

    @property
    def motion(self) -> Motion:
        """Motion of the vehicle."""
        mass = self._mass
        return mass.position, mass.velocity, mass.acceleration

    @property
    def desired(self) -> Motion:
        """Motion of the desired trajectory."""
        shaping = self._shaping
        return shaping.position, shaping.velocity, shaping.acceleration

    def restart(self, position: Vector) -> None:
        """Rest at ``position``, with the integral reset."""
        self._mass.restart(position)
        self._shaping.restart(position, ZERO, ZERO)
        self._asked: Vector = ZERO
        self._error: Pair = (0.0, 0.0)
        self._slip: Pair | None = None
        self._trend: Pair = (0.0, 0.0)
        self._learnt: Pair = (0.0, 0.0)
        self._limited: Pair = (0.0, 0.0)

    def relocate(self, position: Vector, velocity: Vector) -> None:
        """Handle a jump of the estimate to ``position`` and ``velocity``.

        The desired position is shifted by the same amount, so the position error is unchanged.
        """
        mass, shaping = self._mass, self._shaping
        shift = tuple(new - old for new, old in zip(position, mass.position, strict=True))
        x, y, z = (old + by for old, by in zip(shaping.position, shift, strict=True))
        shaping.restart((x, y, z), shaping.velocity, shaping.acceleration)
        mass.position, mass.velocity = position, velocity

    def advance(self, wanted: Motion, dt: float, wind: Vector = ZERO, drift: Vector = ZERO) -> None:
        """Advance by ``dt`` seconds towards ``wanted``, which is valid at their end.

        ``wind`` (m/s) is the velocity of the air.
        """
        self._mass.advance(self._asked, wind, dt, drift)
        slip = (0.0, 0.0) if self._slip is None else self._slip
        self._shaping.advance(wanted, dt, self._limited, self._error, slip)
        north, east = self._level(dt)
        self._asked = (north, east, self._vertical())

    def _level(self, dt: float) -> Pair:
        gains, mass, shaping = self._gains, self._mass, self._shaping
        x, y, z = shaping.position
        error = x - mass.position[0], y - mass.position[1]
        # The desired position never leads by more than corrections of the permitted speed can close.
        near = cut(error, inverse_square_root_law(self._speeds.level, gains.position, gains.acceleration))
        if near != error:
            error = near
            place = mass.position[0] + near[0], mass.position[1] + near[1], z
            shaping.restart(place, shaping.velocity, shaping.acceleration)
        closing = directed(error, gains.position, gains.acceleration)
        slip = (
            closing[0] + shaping.velocity[0] - mass.velocity[0],
            closing[1] + shaping.velocity[1] - mass.velocity[1],
        )
        self._error = error
        self._filter(slip, dt)
        self._learn(dt)
        slip = self._slip or (0.0, 0.0)
        north, east = (
            gains.velocity * slip[axis]
            + self._learnt[axis]
            + gains.derivative * self._trend[axis]
            + shaping.acceleration[axis]
            for axis in (0, 1)
        )
        return self._leaned((north, east))

    def _filter(self, slip: Pair, dt: float) -> None:
        """Filter the velocity error and its derivative, first order, both with the same frequency."""
        if self._slip is None:
            self._slip = slip
            return
        omega = 2.0 * math.pi * self._gains.filter_hz * dt
        share = omega / (1.0 + omega)
        old, trend = self._slip, self._trend
        new = old[0] + share * (slip[0] - old[0]), old[1] + share * (slip[1] - old[1])
        self._trend = (
            trend[0] + share * ((new[0] - old[0]) / dt - trend[0]),
            trend[1] + share * ((new[1] - old[1]) / dt - trend[1]),
        )
        self._slip = new

    def _learn(self, dt: float) -> None:
        """Update the integral; it does not grow in a direction in which the lean angle is at its limit."""
        slip, before = self._slip or (0.0, 0.0), self._learnt
        gain = self._gains.integral * dt
        learnt = before[0] + gain * slip[0], before[1] + gain * slip[1]
        self._learnt = cut(learnt, math.hypot(*before)) if same_way(slip, self._limited) else learnt

    def _leaned(self, acceleration: Pair) -> Pair:
        """Limit the acceleration to ANGLE_MAX; the part across the desired velocity has priority."""
        most = GRAVITY * math.tan(self._gains.tilt)
        self._limited = (0.0, 0.0)
        if math.hypot(*acceleration) <= most:
            return acceleration
        self._limited = acceleration
        along, across, direction = split(acceleration, self._shaping.velocity[:2])
        across = cut(across, most)
        room = math.sqrt(max(most * most - across[0] ** 2 - across[1] ** 2, 0.0))
        return joined(max(-room, min(room, along)), across, direction)

    def _vertical(self) -> float:
        gains, speeds, mass, shaping = self._gains, self._speeds, self._mass, self._shaping
        error = shaping.position[2] - mass.position[2]
        closing = square_root_law(error, gains.position_z, gains.acceleration_z)
        closing = max(-speeds.up, min(speeds.down, closing))
        slip = closing + shaping.velocity[2] - mass.velocity[2]
        return gains.velocity_z * slip + shaping.acceleration[2]


def _speeds(config: AutopilotConfig) -> Speeds:
    return Speeds(config.waypoint_speed, config.waypoint_climb, config.waypoint_sink)
