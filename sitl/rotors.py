"""Rotors: the lag of the motors, and the wrench of turning rotors in moving air (the RotorS model)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sitl.compiled import kernel
from sitl.vectors import Vector, cross, plus

if TYPE_CHECKING:
    from sitl.airframe import Airframe, FloatArray

_AT_REST = 1e-3


@kernel
def half_step(speeds: FloatArray, commanded: FloatArray, airframe: Airframe) -> None:
    """Move the rotor speeds (n,) (rad/s), in place, by half a physics step towards the commanded ones.

    First-order lag, solved exactly for a held command; spinning up and down have their own time constants. A
    rotor that is told to stop ends at zero instead of creeping through denormal numbers.
    """
    for i in range(speeds.size):
        excess = speeds[i] - commanded[i]
        decay = airframe.half_step_decay_down if excess > 0.0 else airframe.half_step_decay_up
        speeds[i] = commanded[i] + decay * excess
        if commanded[i] == 0.0 and speeds[i] < _AT_REST:
            speeds[i] = 0.0


@kernel
def wrench(
    speeds: FloatArray, air_velocity: Vector, rates: Vector, airframe: Airframe
) -> tuple[Vector, Vector]:
    """Force (N) and moment (N m) on the body, both in body axes, of rotors turning at ``speeds`` (n,) rad/s.

    ``air_velocity`` is that of the centre of mass relative to the air (m/s, body), ``rates`` are the body
    rates. Each rotor gives a thrust k_f ω² along −b3, its drag torque, a rotor drag −c|ω|v⊥ at the hub and a
    rolling moment −c_r|ω|v⊥, where v⊥ is the hub's velocity through the air in the plane of the rotor.
    """
    force = (0.0, 0.0, 0.0)
    moment = (0.0, 0.0, 0.0)
    for i in range(speeds.size):
        arm = (airframe.rotor_x[i], airframe.rotor_y[i], airframe.rotor_z[i])
        hub_velocity = plus(air_velocity, 1.0, cross(rates, arm))
        thrust = airframe.k_f * speeds[i] * speeds[i]
        drag = airframe.rotor_drag * speeds[i]
        roll = airframe.rolling_moment * speeds[i]
        rotor_force = (-drag * hub_velocity[0], -drag * hub_velocity[1], -thrust)
        rotor_moment = (
            -roll * hub_velocity[0],
            -roll * hub_velocity[1],
            airframe.rotor_spin[i] * airframe.k_m * thrust,
        )
        force = plus(force, 1.0, rotor_force)
        moment = plus(plus(moment, 1.0, rotor_moment), 1.0, cross(arm, rotor_force))
    return force, moment
