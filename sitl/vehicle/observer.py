"""The disturbance observer: what pushes and turns the vehicle that the controller has not reckoned with.

What an inertial unit feels (specific force, and angular acceleration by Euler's equation) less what sound
rotors at these motor speeds would give in still air. What is left, a wind, a failed rotor, a wrong mass, goes
through a low-pass of first order and is what the controller then counters. It is no integral of the error, so
it does not wind up: a limit that keeps the rotors from doing what is wanted is no disturbance.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sitl.vehicle.compiled import kernel
from sitl.vehicle.simd import some, where
from sitl.vehicle.vectors import Axes, Vector, dot, greatest, least, plus, times, to_ned

if TYPE_CHECKING:
    from sitl.vehicle.airframe import Airframe

Disturbance = tuple[Vector, Vector]
"""A force (N, NED) and a moment (N m, body)."""


@kernel
def drag_moment(velocity: Vector, yaw_rate: float, airframe: Airframe) -> Vector:
    """The moment (N m, body) that cancels what rotor drag does at a velocity (m/s, body) in still air."""
    low, roll = airframe.cancelled_drag_arm, airframe.cancelled_rolling
    return (
        roll * velocity[0] - low * velocity[1],
        roll * velocity[1] + low * velocity[0],
        airframe.cancelled_turning * yaw_rate,
    )


@kernel
def observed(
    known: Disturbance,
    force: Vector,
    moment: Vector,
    sound_thrust: float,
    sound_moment: Vector,
    velocity: Vector,
    rates: Vector,
    axes: Axes,
    airframe: Airframe,
) -> Disturbance:
    """The disturbance after a physics step, from the one ``known`` before it.

    ``force`` (N) and ``moment`` (N m) are those felt in the step, ``sound_thrust`` (N) and ``sound_moment``
    those of sound rotors, ``velocity`` (m/s) and ``rates`` (rad/s) those of the vehicle, all in body axes;
    ``axes`` takes them to NED.
    """
    D = airframe.cancelled_drag
    strange = (force[0] + D * velocity[0], force[1] + D * velocity[1], force[2] + sound_thrust)
    push = plus(known[0], airframe.force_learnt, plus(to_ned(axes, strange), -1.0, known[0]))
    square, most = dot(push, push), airframe.max_disturbance_force
    beyond = square > most * most
    if some(beyond):
        push = times(where(beyond, most / math.sqrt(square), 1.0), push)
    strange = plus(plus(moment, -1.0, sound_moment), 1.0, drag_moment(velocity, rates[2], airframe))
    turn = plus(known[1], airframe.moment_learnt, plus(strange, -1.0, known[1]))
    limit = airframe.max_disturbance_moment
    return push, (
        greatest(-limit[0], least(limit[0], turn[0])),
        greatest(-limit[1], least(limit[1], turn[1])),
        greatest(-limit[2], least(limit[2], turn[2])),
    )
