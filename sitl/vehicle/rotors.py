"""Rotors: the lag of the motors, and the wrench of rotors in moving air (the RotorS model)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sitl.vehicle.compiled import kernel
from sitl.vehicle.simd import at, put, where
from sitl.vehicle.vectors import Vector, plus

if TYPE_CHECKING:
    from sitl.vehicle.airframe import Airframe, FloatArray

_AT_REST = 1e-3


@kernel
def half_step(speeds: FloatArray, commanded: FloatArray, airframe: Airframe) -> None:
    """Move the motor speeds (n,) (rad/s), in place, by half a physics step towards the commanded ones.

    First-order lag, solved exactly for a held command, with separate time constants for spinning up and down.
    A motor commanded to stop ends at zero instead of decaying through denormal numbers.
    """
    for i in range(airframe.rotor_x.size):
        wanted = at(commanded, i)
        excess = at(speeds, i) - wanted
        decay = where(excess > 0.0, airframe.half_step_decay_down, airframe.half_step_decay_up)
        speed = wanted + decay * excess
        put(speeds, i, where(speed < where(wanted > 0.0, 0.0, _AT_REST), 0.0, speed))


@kernel
def wrench(
    speeds: FloatArray, left: FloatArray, air_velocity: Vector, rates: Vector, airframe: Airframe
) -> tuple[Vector, Vector, float, Vector]:
    """Return the rotors' force (N) and moment (N m), then thrust and moment without faults and drag.

    All act on the body and are given in body axes, for motors that turn at ``speeds`` (n,) rad/s. ``left``
    (n,) is the remaining fraction of each rotor's speed (0…1). ``air_velocity`` is the velocity of the centre
    of mass relative to the air (m/s, body), ``rates`` are the body rates. A rotor with the speed ω (rad/s)
    gives a thrust k_f ω² along −b3, a drag torque of size k_m k_f ω², a rotor drag −c|ω|v⊥ at the hub and a
    rolling moment −c_r|ω|v⊥. Here v⊥ is the hub's velocity through the air in the plane of the rotor, c is
    ``rotor_drag`` and c_r is ``rolling_moment``.
    """
    force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    intact_thrust, intact_moment = 0.0, (0.0, 0.0, 0.0)
    for i in range(airframe.rotor_x.size):
        x, y, z = airframe.rotor_x[i], airframe.rotor_y[i], airframe.rotor_z[i]
        torque = airframe.rotor_spin[i] * airframe.k_m
        hub_x = air_velocity[0] + (rates[1] * z - rates[2] * y)
        hub_y = air_velocity[1] + (rates[2] * x - rates[0] * z)
        motor = at(speeds, i)
        speed = at(left, i) * motor
        thrust = airframe.k_f * (speed * speed)
        drag, roll = airframe.rotor_drag * speed, airframe.rolling_moment * speed
        push_x, push_y = -drag * hub_x, -drag * hub_y
        force = plus(force, 1.0, (push_x, push_y, -thrust))
        turn = (
            -y * thrust - z * push_y,
            x * thrust + z * push_x,
            torque * thrust + (x * push_y - y * push_x),
        )
        moment = plus(moment, 1.0, turn)
        moment = plus(moment, -roll, (hub_x, hub_y, 0.0))
        full_thrust = airframe.k_f * (motor * motor)
        intact_thrust = intact_thrust + full_thrust
        intact_moment = plus(intact_moment, full_thrust, (-y, x, torque))
    return force, moment, intact_thrust, intact_moment
