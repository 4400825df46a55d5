"""Allocation: the controller's wrench → the speed of each rotor, within the rotors' limits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sitl.vehicle.compiled import kernel
from sitl.vehicle.simd import at, put, some, where
from sitl.vehicle.vectors import Vector, greatest, least

if TYPE_CHECKING:
    from sitl.vehicle.airframe import Airframe, FloatArray


def effectiveness(rotor_x: FloatArray, rotor_y: FloatArray, rotor_spin: FloatArray, k_m: float) -> FloatArray:
    """Return the (4, n) matrix from rotor thrusts (N) to total thrust (N) and moments about FRD (N m).

    Arms (n,) in metres; spin (n,) is +1 for a rotor that turns counter-clockwise seen from above, whose drag
    torque turns the body clockwise, to positive yaw. ``k_m`` is drag torque over thrust (m).
    """
    return np.vstack([np.ones_like(rotor_x), -rotor_y, rotor_x, k_m * rotor_spin])


@kernel
def _collective_range(rotor_thrusts: FloatArray, airframe: Airframe) -> tuple[float, float]:
    """Return the range of total thrust (N) that, added to the given thrusts, keeps each rotor in its limits.

    The range is empty (lower limit above upper limit) if there is no such thrust.
    """
    low, high = -math.inf, math.inf
    for i in range(airframe.rotor_x.size):
        thrust, rotors = at(rotor_thrusts, i), airframe.rotor_share[i]
        low = greatest(low, (airframe.min_thrust - thrust) * rotors)
        high = least(high, (airframe.max_thrust - thrust) * rotors)
    return low, high


@kernel
def _feasible_tilting(tilting: FloatArray, airframe: Airframe) -> float:
    """Return the largest part (0…1) of the thrusts ``tilting`` (n,) (N) that the rotors can produce.

    With this part, there is a total thrust that keeps each rotor in its limits.
    """
    part = 1.0
    for i in range(airframe.rotor_x.size):
        for j in range(airframe.rotor_x.size):
            rotors_i, rotors_j = airframe.rotor_share[i], airframe.rotor_share[j]
            spread = at(tilting, j) * rotors_j - at(tilting, i) * rotors_i
            room = airframe.max_thrust * rotors_j - airframe.min_thrust * rotors_i
            part = where(part * spread > room, room / spread, part)
    return part


@kernel
def _feasible_turning(rotor_thrusts: FloatArray, yaw_moment: float, airframe: Airframe) -> float:
    """Return the largest part (0…1) of a yaw moment (N m) that the rotors can still produce."""
    part, excess = 1.0, 0.0
    for i in range(airframe.rotor_x.size):
        turning = airframe.mixer[i, 3] * yaw_moment
        room = where(turning > 0.0, airframe.max_thrust, airframe.min_thrust) - at(rotor_thrusts, i)
        excess = greatest(excess, abs(turning) - abs(room))
    if some(excess > 0.0):
        for i in range(airframe.rotor_x.size):
            turning = airframe.mixer[i, 3] * yaw_moment
            room = where(turning > 0.0, airframe.max_thrust, airframe.min_thrust) - at(rotor_thrusts, i)
            part = where(abs(part * turning) > abs(room), abs(room / turning), part)
    return part


@kernel
def allocate(thrust: float, moment: Vector, airframe: Airframe, commanded: FloatArray) -> None:
    """Write the rotor speeds (n,) (rad/s) that give ``thrust`` (N, along −b3) and ``moment`` (N m, body).

    This is the least-squares solution by the pseudo-inverse. If a rotor would exceed its limits, yaw is
    reduced first, then the total thrust is lowered or raised. Roll and pitch, which keep the vehicle upright,
    are reduced only if no total thrust keeps each rotor in its limits.
    """
    n = airframe.rotor_x.size
    for i in range(n):
        put(commanded, i, airframe.mixer[i, 1] * moment[0] + airframe.mixer[i, 2] * moment[1])
    low, high = _collective_range(commanded, airframe)
    infeasible = low > high
    if some(infeasible):
        part = where(infeasible, _feasible_tilting(commanded, airframe), 1.0)
        for i in range(n):
            put(commanded, i, part * at(commanded, i))
        low, high = _collective_range(commanded, airframe)
    collective = greatest(low, least(high, thrust))
    for i in range(n):
        put(commanded, i, at(commanded, i) + airframe.mixer[i, 0] * collective)
    yaw_moment = _feasible_turning(commanded, moment[2], airframe) * moment[2]
    for i in range(n):
        wanted = at(commanded, i) + airframe.mixer[i, 3] * yaw_moment
        # Rounding may exceed a limit by the last bit.
        wanted = greatest(airframe.min_thrust, least(airframe.max_thrust, wanted))
        put(commanded, i, math.sqrt(wanted * airframe.speed_squared))
