"""Allocation: the wrench that the controller wants → the speed of each rotor, within what rotors can do."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sitl.compiled import kernel
from sitl.vectors import Vector

if TYPE_CHECKING:
    from sitl.airframe import Airframe, FloatArray


def effectiveness(rotor_x: FloatArray, rotor_y: FloatArray, rotor_spin: FloatArray, k_m: float) -> FloatArray:
    """The (4, n) matrix from rotor thrusts (N) to total thrust (N) and moments about FRD (N m).

    Arms (n,) in metres; spin (n,) is +1 for a rotor that turns counter-clockwise seen from above, whose drag
    torque turns the body clockwise, to positive yaw. ``k_m`` is drag torque over thrust (m).
    """
    return np.vstack([np.ones_like(rotor_x), -rotor_y, rotor_x, k_m * rotor_spin])


@kernel
def _collective_range(rotor_thrusts: FloatArray, airframe: Airframe) -> tuple[float, float]:
    """The total thrusts (N) that keep every rotor within its limits when added to the given thrusts."""
    low, high = -math.inf, math.inf
    for i in range(rotor_thrusts.size):
        share = airframe.mixer[i, 0]
        low = max(low, (airframe.min_thrust - rotor_thrusts[i]) / share)
        high = min(high, (airframe.max_thrust - rotor_thrusts[i]) / share)
    return low, high


@kernel
def _feasible_tilting(tilting: FloatArray, airframe: Airframe) -> float:
    """The largest part (0…1) of roll and pitch that leaves some total thrust within all limits."""
    part = 1.0
    for i in range(tilting.size):
        for j in range(tilting.size):
            share_i, share_j = airframe.mixer[i, 0], airframe.mixer[j, 0]
            spread = tilting[j] / share_j - tilting[i] / share_i
            room = airframe.max_thrust / share_j - airframe.min_thrust / share_i
            if part * spread > room:
                part = room / spread
    return part


@kernel
def allocate(thrust: float, moment: Vector, airframe: Airframe, commanded: FloatArray) -> None:
    """Write the rotor speeds (n,) (rad/s) that give ``thrust`` (N, along −b3) and ``moment`` (N m, body).

    The least-squares solution by the pseudo-inverse. When a rotor would leave its limits, yaw gives way
    first, then the total thrust, and roll and pitch, which hold the vehicle up, only when no total thrust can
    carry them.
    """
    n = commanded.size
    for i in range(n):
        commanded[i] = airframe.mixer[i, 1] * moment[0] + airframe.mixer[i, 2] * moment[1]
    low, high = _collective_range(commanded, airframe)
    if low > high:
        part = _feasible_tilting(commanded, airframe)
        for i in range(n):
            commanded[i] *= part
        low, high = _collective_range(commanded, airframe)
    collective = max(low, min(high, thrust))
    yaw_part = 1.0
    for i in range(n):
        commanded[i] += airframe.mixer[i, 0] * collective
        turning = airframe.mixer[i, 3] * moment[2]
        room = (airframe.max_thrust if turning > 0.0 else airframe.min_thrust) - commanded[i]
        if abs(yaw_part * turning) > abs(room):
            yaw_part = abs(room / turning)
    for i in range(n):
        wanted = commanded[i] + yaw_part * airframe.mixer[i, 3] * moment[2]
        # Rounding may leave a limit by the last bit.
        wanted = max(airframe.min_thrust, min(airframe.max_thrust, wanted))
        commanded[i] = math.sqrt(wanted / airframe.k_f)
