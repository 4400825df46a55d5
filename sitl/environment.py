"""The surroundings: gravity and the ground. The wind comes with each command."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sitl.body import Motion, body_axes, turned
from sitl.compiled import kernel
from sitl.vectors import plus, times

if TYPE_CHECKING:
    from sitl.airframe import Airframe

GRAVITY = 9.80665
"""Standard gravity, m/s²."""

_RIGHTING_TIME = 0.1
"""How fast the gear brings a tilted vehicle flat on the ground (s)."""
_TIPPED = 0.5
"""Cosine of the tilt beyond which the vehicle lies on its side and stays so."""
_FLAT = 1e-9
"""Tilt (rad) that counts as flat."""


@kernel
def ground_contact(before: Motion, after: Motion, ground: float, airframe: Airframe) -> tuple[Motion, bool]:
    """Amend a free step from ``before`` to ``after`` where it ran into the plane z = ``ground`` (m, NED).

    Returns the motion and whether the vehicle stood on the ground. The ground stops the fall without a
    bounce; the impulse that it needs for that bounds, by Coulomb's law, the friction against sliding and
    turning, and through the radius of the gear the impulse that holds the vehicle flat. So a vehicle lifts
    off as soon as thrust exceeds weight, and one at rest stays where it is to the last bit, because it is
    moved by its velocities after contact.
    """
    floor = ground - airframe.rest_height
    position, velocity, attitude, rates = after
    fall = velocity[2]
    if position[2] < floor:
        return after, False
    if fall < 0.0:
        return ((position[0], position[1], floor), velocity, attitude, rates), False

    speed = math.hypot(velocity[0], velocity[1])
    friction = airframe.ground_friction * fall
    kept = 1.0 - friction / speed if speed > friction else 0.0
    velocity = (kept * velocity[0], kept * velocity[1], 0.0)

    impulse = airframe.mass * fall * airframe.gear_radius
    b1, b2, b3 = body_axes(before[2])
    down_body = (b1[2], b2[2], b3[2])
    at_peace = math.hypot(down_body[0], down_body[1]) < _FLAT or down_body[2] < _TIPPED
    righting = 0.0 if at_peace else 1.0 / _RIGHTING_TIME
    settling = (-righting * down_body[1], righting * down_body[0])
    excess = (rates[0] - settling[0], rates[1] - settling[1])
    tilting = math.hypot(airframe.inertia[0] * excess[0], airframe.inertia[1] * excess[1])
    left = 1.0 - impulse / tilting if tilting > impulse else 0.0
    turning, scrub = airframe.inertia[2] * abs(rates[2]), airframe.ground_friction * impulse
    spin_left = 1.0 - scrub / turning if turning > scrub else 0.0
    rates = (settling[0] + left * excess[0], settling[1] + left * excess[1], spin_left * rates[2])

    h = airframe.step
    moved = plus(plus(before[0], 0.5 * h, before[1]), 0.5 * h, velocity)
    position = (moved[0], moved[1], floor)
    attitude = turned(before[2], times(0.5 * h, plus(before[3], 1.0, rates)))
    return (position, velocity, attitude, rates), True
