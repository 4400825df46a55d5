"""Ground contact and gravity. The wind is part of each command."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sitl.vehicle.body import Motion, body_axes, turned
from sitl.vehicle.compiled import kernel
from sitl.vehicle.simd import some, where
from sitl.vehicle.vectors import chosen, plus, times

if TYPE_CHECKING:
    from sitl.vehicle.airframe import Airframe

GRAVITY = 9.80665
"""Standard gravity, m/s²."""

_RIGHTING_TIME = 0.1
"""Time constant with which the gear levels a tilted vehicle on the ground (s)."""
_COS_LYING_TILT = 0.5
"""Cosine of the tilt beyond which the vehicle lies on its side and stays so."""
_LEVEL_TILT = 1e-9
"""Tilt (rad) that counts as level."""


@kernel
def ground_contact(before: Motion, after: Motion, ground: float, airframe: Airframe) -> tuple[Motion, bool]:
    """Correct a free step from ``before`` to ``after`` if it ends with the gear at or below the ground.

    ``ground`` is the z of the ground (m, NED); the centre of mass is kept ``rest_height`` above it. Returns
    the motion and whether the vehicle stood on the ground. If the vehicle moves up, only its position is
    corrected, so it lifts off as soon as thrust exceeds weight. Otherwise the ground stops the fall without a
    bounce. The impulse that stops the fall limits, by Coulomb's law, the friction against sliding and
    turning, and, through the radius of the gear, the impulse that keeps the vehicle level. A vehicle at rest
    keeps its position to the last bit, because the step is integrated with the mean of the velocities before
    and after contact, both zero.
    """
    floor = ground - airframe.rest_height
    position, velocity, attitude, rates = after
    below = position[2] >= floor
    standing = below & (velocity[2] >= 0.0)
    if some(below):
        position = (position[0], position[1], where(below, floor, position[2]))
        if some(standing):
            stood = _stood(before, after, floor, airframe)
            position, velocity = chosen(standing, stood[0], position), chosen(standing, stood[1], velocity)
            attitude = (
                where(standing, stood[2][0], attitude[0]),
                where(standing, stood[2][1], attitude[1]),
                where(standing, stood[2][2], attitude[2]),
                where(standing, stood[2][3], attitude[3]),
            )
            rates = chosen(standing, stood[3], rates)
    return (position, velocity, attitude, rates), standing


@kernel
def _stood(before: Motion, after: Motion, floor: float, airframe: Airframe) -> Motion:
    """Return the motion at the end of a step corrected by the ground."""
    _, velocity, _, rates = after
    fall = velocity[2]
    friction = airframe.ground_friction * fall
    kept = _part_left(_length(velocity[0], velocity[1]), friction)
    velocity = (kept * velocity[0], kept * velocity[1], 0.0)

    impulse = airframe.mass * fall * airframe.gear_radius
    b1, b2, b3 = body_axes(before[2])
    flat = _length(b1[2], b2[2]) < _LEVEL_TILT
    righting = where(flat | (b3[2] < _COS_LYING_TILT), 0.0, 1.0 / _RIGHTING_TIME)
    settling = (-righting * b2[2], righting * b1[2])
    excess = (rates[0] - settling[0], rates[1] - settling[1])
    J = airframe.inertia
    left = _part_left(_length(J[0] * excess[0], J[1] * excess[1]), impulse)
    spin_left = _part_left(J[2] * abs(rates[2]), airframe.ground_friction * impulse)
    rates = (settling[0] + left * excess[0], settling[1] + left * excess[1], spin_left * rates[2])

    h = airframe.step
    moved = plus(plus(before[0], 0.5 * h, before[1]), 0.5 * h, velocity)
    attitude = turned(before[2], times(0.5 * h, plus(before[3], 1.0, rates)))
    return (moved[0], moved[1], floor), velocity, attitude, rates


@kernel
def _part_left(size: float, taken: float) -> float:
    """Return the remaining part of a quantity ``size`` after ``taken`` is subtracted, at least 0."""
    return where(size > taken, 1.0 - taken / size, 0.0)


@kernel
def _length(x: float, y: float) -> float:
    return math.sqrt(x * x + y * y)
