"""ArduCopter 4.6's GUIDED position controller: desired trajectory → position → velocity → lean angle."""

from __future__ import annotations

import math
from typing import Self

from mavlink_bridge.messages import Vector
from sitl.autopilot.position_control.airframe import ARDUPILOT, GRAVITY, Motion, PointMass
from sitl.autopilot.position_control.ardupilot_height import HeightControl
from sitl.autopilot.position_control.ardupilot_shaping import Shaping
from sitl.autopilot.position_control.square_root import (
    Pair,
    cut,
    directed,
    inverse_square_root_law,
    joined,
    same_way,
    split,
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
        self._height = HeightControl(gains, speeds)
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
        self._height.configure(self._gains, self._speeds)

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
        """Rest at ``position``, with the integrals reset."""
        self._mass.restart(position)
        self._height.restart()
        self._shaping.restart(position, ZERO, ZERO)
        self._commanded: Vector = ZERO
        self._error: Pair = (0.0, 0.0)
        self._velocity_error: Pair | None = None
        self._velocity_error_rate: Pair = (0.0, 0.0)
        self._integral: Pair = (0.0, 0.0)
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
        """Advance by ``dt`` seconds towards ``wanted``, which is valid at the end of the step.

        ``wind`` (m/s) is the velocity of the air; ``drift`` as for ``Response``.
        """
        self._mass.advance(self._commanded, wind, dt, drift)
        velocity_error = (0.0, 0.0) if self._velocity_error is None else self._velocity_error
        self._shaping.advance(wanted, dt, self._limited, self._error, velocity_error)
        north, east = self._horizontal(dt)
        mass = self._mass
        (_, _, z), (_, _, w), (_, _, c) = self.desired
        actual = mass.position[2], mass.velocity[2], mass.acceleration[2]
        down = self._height.advance((z, w, c), actual, dt, mass.highest)
        self._commanded = (north, east, down)

    def _horizontal(self, dt: float) -> Pair:
        gains, mass, shaping = self._gains, self._mass, self._shaping
        x, y, z = shaping.position
        error = x - mass.position[0], y - mass.position[1]
        # The position error is limited to the one for which the square-root law gives the greatest speed.
        near = cut(error, inverse_square_root_law(self._speeds.level, gains.position, gains.acceleration))
        if near != error:
            error = near
            place = mass.position[0] + near[0], mass.position[1] + near[1], z
            shaping.restart(place, shaping.velocity, shaping.acceleration)
        closing = directed(error, gains.position, gains.acceleration)
        velocity_error = (
            closing[0] + shaping.velocity[0] - mass.velocity[0],
            closing[1] + shaping.velocity[1] - mass.velocity[1],
        )
        self._error = error
        self._filter(velocity_error, dt)
        self._integrate(dt)
        velocity_error = self._velocity_error or (0.0, 0.0)
        north, east = (
            gains.velocity * velocity_error[axis]
            + self._integral[axis]
            + gains.derivative * self._velocity_error_rate[axis]
            + shaping.acceleration[axis]
            for axis in (0, 1)
        )
        return self._limited_by_tilt((north, east))

    def _filter(self, velocity_error: Pair, dt: float) -> None:
        """Filter the velocity error and its derivative, first order, both with the same frequency."""
        if self._velocity_error is None:
            self._velocity_error = velocity_error
            return
        omega = 2.0 * math.pi * self._gains.filter_hz * dt
        gain = omega / (1.0 + omega)
        old, error_rate = self._velocity_error, self._velocity_error_rate
        new = old[0] + gain * (velocity_error[0] - old[0]), old[1] + gain * (velocity_error[1] - old[1])
        self._velocity_error_rate = (
            error_rate[0] + gain * ((new[0] - old[0]) / dt - error_rate[0]),
            error_rate[1] + gain * ((new[1] - old[1]) / dt - error_rate[1]),
        )
        self._velocity_error = new

    def _integrate(self, dt: float) -> None:
        """Update the integral of the velocity error.

        While the lean angle is limited, an error in the direction of the limited acceleration cannot lengthen
        the integral.
        """
        velocity_error, before = self._velocity_error or (0.0, 0.0), self._integral
        gain = self._gains.integral * dt
        integral = before[0] + gain * velocity_error[0], before[1] + gain * velocity_error[1]
        self._integral = (
            cut(integral, math.hypot(*before)) if same_way(velocity_error, self._limited) else integral
        )

    def _limited_by_tilt(self, acceleration: Pair) -> Pair:
        """Limit the acceleration to that of a lean angle of ANGLE_MAX.

        The part across the desired velocity has priority.
        """
        limit = GRAVITY * math.tan(self._gains.tilt)
        self._limited = (0.0, 0.0)
        if math.hypot(*acceleration) <= limit:
            return acceleration
        self._limited = acceleration
        along, across, direction = split(acceleration, self._shaping.velocity[:2])
        across = cut(across, limit)
        room = math.sqrt(max(limit * limit - across[0] ** 2 - across[1] ** 2, 0.0))
        return joined(max(-room, min(room, along)), across, direction)


def _speeds(config: AutopilotConfig) -> Speeds:
    return Speeds(config.waypoint_speed, config.waypoint_climb, config.waypoint_sink)
