"""Disturbance observer: the force and moment on the vehicle that the controller has not accounted for.

It takes the measurement of an inertial unit (specific force, and angular acceleration by Euler's equation)
less the thrust and moment of intact rotors at these motor speeds and the rotor drag that the controller
cancels. The rest (a wind, a failed rotor, a wrong mass) passes a first-order low-pass, is limited, and is
then cancelled by the controller. The estimate is no integral of the control error, so it does not wind up
when the rotors cannot produce the requested wrench.
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
    """Return the moment (N m, body) that cancels rotor drag at a velocity (m/s, body) in still air."""
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
    intact_thrust: float,
    intact_moment: Vector,
    velocity: Vector,
    rates: Vector,
    axes: Axes,
    airframe: Airframe,
) -> Disturbance:
    """Return the disturbance after a physics step, from the one ``known`` before it.

    ``force`` (N) and ``moment`` (N m) are those measured in the step, ``intact_thrust`` (N) and
    ``intact_moment`` those of intact rotors, ``velocity`` (m/s) and ``rates`` (rad/s) those of the vehicle,
    all in body axes; ``axes`` are these axes in NED.
    """
    D = airframe.cancelled_drag
    unexplained = (force[0] + D * velocity[0], force[1] + D * velocity[1], force[2] + intact_thrust)
    new_force = plus(known[0], airframe.force_learnt, plus(to_ned(axes, unexplained), -1.0, known[0]))
    square, max_force = dot(new_force, new_force), airframe.max_disturbance_force
    beyond = square > max_force * max_force
    if some(beyond):
        new_force = times(where(beyond, max_force / math.sqrt(square), 1.0), new_force)
    unexplained = plus(plus(moment, -1.0, intact_moment), 1.0, drag_moment(velocity, rates[2], airframe))
    new_moment = plus(known[1], airframe.moment_learnt, plus(unexplained, -1.0, known[1]))
    limit = airframe.max_disturbance_moment
    return new_force, (
        greatest(-limit[0], least(limit[0], new_moment[0])),
        greatest(-limit[1], least(limit[1], new_moment[1])),
        greatest(-limit[2], least(limit[2], new_moment[2])),
    )
