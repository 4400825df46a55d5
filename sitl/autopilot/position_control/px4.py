"""PX4 1.16's OFFBOARD position controller: set-point → position → velocity → tilt, without shaping.

PX4 does not shape offboard set-points: neither MPC_ACC_HOR nor MPC_JERK_MAX applies, only the limits of speed
and tilt, and the lag of the attitude. A set-point is constant between two messages.
"""

from __future__ import annotations

import math
from typing import Final

from mavlink_bridge.messages import Vector
from sitl.autopilot.position_control.airframe import GRAVITY, PX4, Motion, PointMass
from sitl.autopilot.position_control.square_root import Pair, cut
from sitl.config.autopilot import AutopilotConfig
from sitl.config.gains import Px4Gains
from sitl.values.setpoints import ZERO

_HOVER_TIME: Final = 12.0
"""Time constant (s) of the hover thrust's estimate, as logged flights have it (HTE_HT_NOISE)."""
_HOVER_RANGE: Final = (0.6, 1.4)
"""Bounds of that estimate, as shares of the true hover thrust: HTE_THR_RANGE around MPC_THR_HOVER."""
_LEAST_WEIGHT: Final = 0.1
"""Share of gravity below which the thrust says nothing of hovering."""


class Px4Response:
    """Response of a PX4 to set-points: ``motion``, local NED."""

    def __init__(self, gains: Px4Gains) -> None:
        self._gains = gains
        self._mass = PointMass(PX4)
        self.restart(ZERO)

    def configure(self, config: AutopilotConfig) -> None:
        """Use new parameters from now on."""
        self._gains = config.px4

    @property
    def motion(self) -> Motion:
        """Motion of the vehicle."""
        mass = self._mass
        return mass.position, mass.velocity, mass.acceleration

    @property
    def desired(self) -> Motion:
        """Motion of the vehicle, because PX4 has no trajectory of its own."""
        return self.motion

    def restart(self, position: Vector) -> None:
        """Rest at ``position``, with the integrals reset."""
        self._mass.restart(position)
        self._commanded: Vector = ZERO
        self._integral: Vector = ZERO
        self._hover = 1.0
        self._previous_velocity: Vector = ZERO
        self._acceleration: Pair = (0.0, 0.0)

    def relocate(self, position: Vector, velocity: Vector) -> None:
        """Handle a jump of the estimate to ``position`` and ``velocity``."""
        self._mass.position, self._mass.velocity = position, velocity
        self._previous_velocity = velocity

    def advance(self, wanted: Motion, dt: float, wind: Vector = ZERO, drift: Vector = ZERO) -> None:
        """Advance by ``dt`` seconds towards ``wanted``; ``wind`` and ``drift`` (m/s) as for ``Response``."""
        self._mass.advance(self._commanded, wind, dt, drift)
        gains, mass = self._gains, self._mass
        self._differentiate(dt)
        place, velocity, acceleration = wanted
        closing = tuple(
            gain * (goal - here)
            for gain, goal, here in zip(
                (gains.position, gains.position, gains.position_z), place, mass.position, strict=True
            )
        )
        aim = _within((closing[0], closing[1]), (velocity[0], velocity[1]), gains.speed)
        sink = max(-gains.speed_up, min(gains.speed_down, closing[2] + velocity[2]))
        velocity_error = aim[0] - mass.velocity[0], aim[1] - mass.velocity[1], sink - mass.velocity[2]
        north, east = (
            acceleration[axis]
            + gains.velocity * velocity_error[axis]
            + self._integral[axis]
            - gains.derivative * self._acceleration[axis]
            for axis in (0, 1)
        )
        tilted = cut((north, east), GRAVITY * math.tan(gains.tilt))
        down = acceleration[2] + gains.velocity_z * velocity_error[2] + self._integral[2]
        lift = self._hover * (GRAVITY - down)
        self._commanded = (*tilted, GRAVITY - lift)
        self._integrate(velocity_error, _excess((north, east), tilted, down), dt)
        self._estimate_hover(lift, down, dt)

    def _differentiate(self, dt: float) -> None:
        """Update the vehicle's acceleration by filtered differentiation of its velocity."""
        gain = dt / (dt + 1.0 / (2.0 * math.pi * self._gains.filter_hz))
        u, v, _ = self._mass.velocity
        before = self._acceleration
        self._acceleration = (
            before[0] + gain * ((u - self._previous_velocity[0]) / dt - before[0]),
            before[1] + gain * ((v - self._previous_velocity[1]) / dt - before[1]),
        )
        self._previous_velocity = self._mass.velocity

    def _integrate(self, velocity_error: Vector, excess: Pair, dt: float) -> None:
        """Update the integrals; the ``excess`` over what is produced reduces those of north and east."""
        gains = self._gains
        back = 2.0 / gains.velocity
        x, y, z = self._integral
        x += gains.integral * (velocity_error[0] - back * excess[0]) * dt
        y += gains.integral * (velocity_error[1] - back * excess[1]) * dt
        z += gains.integral_z * velocity_error[2] * dt
        self._integral = (x, y, max(-GRAVITY, min(GRAVITY, z)))

    def _estimate_hover(self, lift: float, down: float, dt: float) -> None:
        """Estimate the thrust of a hover from a ``lift`` (m/s²) and the acceleration that it gives.

        The integral changes with it, so that the thrust does not.
        """
        weight = 1.0 - self._mass.acceleration[2] / GRAVITY
        if weight < _LEAST_WEIGHT:
            return
        before = self._hover
        after = before - math.expm1(-dt / _HOVER_TIME) * (lift / (GRAVITY * weight) - before)
        self._hover = after = max(_HOVER_RANGE[0], min(_HOVER_RANGE[1], after))
        x, y, z = self._integral
        z += (down - GRAVITY) * (before / after - 1.0)
        self._integral = (x, y, max(-GRAVITY, min(GRAVITY, z)))


def _excess(wanted: Pair, tilted: Pair, down: float) -> Pair:
    """Return by how much the horizontal acceleration ``wanted`` exceeds that of the thrust (m/s²).

    ``tilted``: ``wanted`` within the tilt limit, and what the thrust of a hover produces. With ``down`` m/s²
    downwards the thrust is less, and so is what it produces; if it produces more, that does not count.
    """
    share = max(1.0 - down / GRAVITY, 0.0)
    produced = share * tilted[0], share * tilted[1]
    if math.hypot(*wanted) <= math.hypot(*produced):
        return 0.0, 0.0
    return wanted[0] - produced[0], wanted[1] - produced[1]


def _within(first: Pair, second: Pair, limit: float) -> Pair:
    """Return the sum of two velocities, limited to ``limit``; ``second`` is shortened before ``first``."""
    total = first[0] + second[0], first[1] + second[1]
    if math.hypot(*total) <= limit:
        return total
    size = math.hypot(*first)
    if size >= limit:
        return cut(first, limit)
    # |first + s·second| = limit, 0 ≤ s < 1.
    square = second[0] ** 2 + second[1] ** 2
    half = first[0] * second[0] + first[1] * second[1]
    s = (math.sqrt(half * half + square * (limit * limit - size * size)) - half) / square
    return first[0] + s * second[0], first[1] + s * second[1]
