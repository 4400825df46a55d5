"""Compiled simulation steps of a vehicle with its controller, or of a block of vehicles (``simd``).

reference → controller → allocation → rotors → body → ground → observer → position.

Rows are float64. A *state* row has STATE_SIZE + 2 n columns: position 0:3, velocity 3:6 (m, m/s, NED),
attitude 6:10 (w, x, y, z, body to NED), body rates 10:13 (rad/s, FRD), acceleration 13:16 (m/s², NED) and
angular acceleration 16:19 (rad/s², FRD), both means of the last step, ground contact 19 (1 if it stands on
the ground), the estimated disturbance, force 20:23 (N, NED) and moment 23:26 (N m, FRD),
then the n motor speeds (rad/s) and the n remaining fractions of the motors' speeds (0…1). A *command* row has
COMMAND_SIZE columns: mode 0, the reference's position, velocity, acceleration, jerk, snap 1:16 (NED), yaw,
yaw rate and yaw acceleration 16:19, wind 19:22 (m/s, NED, direction of the air's motion), z of the ground 22
(m, NED).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sitl.vehicle.allocation import allocate
from sitl.vehicle.body import Motion, body_axes, free_flight, turned
from sitl.vehicle.compiled import kernel
from sitl.vehicle.controller import Trajectory, control
from sitl.vehicle.ground import ground_contact
from sitl.vehicle.observer import Disturbance, observed
from sitl.vehicle.rotors import half_step, wrench
from sitl.vehicle.simd import at, put, put_three, some, three_at, where
from sitl.vehicle.vectors import Vector, chosen, plus, times, to_body

if TYPE_CHECKING:
    from sitl.vehicle.airframe import Airframe, FloatArray

STATE_SIZE = 26
LANDED = 19
COMMAND_SIZE = 23
STOPPED, IDLE, FLYING = 0.0, 1.0, 2.0
"""Modes: motors off; rotors turning slowly; following the reference."""


@kernel
def extrapolated(row: FloatArray, t: float) -> Trajectory:
    """Return the reference of a command row after ``t`` seconds: Taylor polynomial and derivatives."""
    x, v, a = three_at(row, 1), three_at(row, 4), three_at(row, 7)
    j, s = three_at(row, 10), three_at(row, 13)
    return (
        plus(x, t, plus(v, t / 2.0, plus(a, t / 3.0, plus(j, t / 4.0, s)))),
        plus(v, t, plus(a, t / 2.0, plus(j, t / 3.0, s))),
        plus(a, t, plus(j, t / 2.0, s)),
        plus(j, t, s),
        s,
    )


@kernel
def command_motors(
    motion: Motion,
    acceleration: Vector,
    known: Disturbance,
    command: FloatArray,
    t: float,
    airframe: Airframe,
    commanded: FloatArray,
) -> None:
    """Write the commanded motor speeds (n,) (rad/s), ``t`` seconds after the start of a command row."""
    mode = at(command, 0)
    if some(mode >= FLYING):
        position, velocity, attitude, rates = motion
        yaw_rate, yaw_acceleration = at(command, 17), at(command, 18)
        thrust, moment = control(
            position,
            velocity,
            acceleration,
            body_axes(attitude),
            rates,
            extrapolated(command, t),
            at(command, 16) + t * (yaw_rate + 0.5 * t * yaw_acceleration),
            yaw_rate + t * yaw_acceleration,
            yaw_acceleration,
            known,
            airframe,
        )
        allocate(thrust, moment, airframe, commanded)
    if some(mode < FLYING):
        resting = where(mode < IDLE, 0.0, airframe.omega_idle)
        for i in range(airframe.rotor_x.size):
            put(commanded, i, where(mode < FLYING, resting, at(commanded, i)))


@kernel
def physics_step(
    motion: Motion,
    acceleration: Vector,
    angular_acceleration: Vector,
    known: Disturbance,
    command: FloatArray,
    speeds: FloatArray,
    left: FloatArray,
    commanded: FloatArray,
    airframe: Airframe,
) -> tuple[Motion, Vector, Vector, Disturbance, float]:
    """Advance one step with the motors held at ``commanded``; update the motor ``speeds`` in place.

    The rotors' wrench is that of the middle of the step: rotor speeds are exact there, body rates and the
    velocity through the air are extrapolated with the accelerations of the last step.
    """
    half_step(speeds, commanded, airframe)
    wind = three_at(command, 19)
    half = 0.5 * airframe.step
    velocity = plus(motion[1], half, acceleration)
    rates = plus(motion[3], half, angular_acceleration)
    axes = body_axes(turned(motion[2], times(half, motion[3])))
    air_velocity = to_body(axes, plus(velocity, -1.0, wind))
    force, moment, intact_thrust, intact_moment = wrench(speeds, left, air_velocity, rates, airframe)
    half_step(speeds, commanded, airframe)
    moved = free_flight(motion, force, moment, airframe)
    moved, standing = ground_contact(motion, moved, at(command, 22), airframe)
    known = observed(
        known, force, moment, intact_thrust, intact_moment, to_body(axes, velocity), rates, axes, airframe
    )
    still = (0.0, 0.0, 0.0)
    idle = standing | (at(command, 0) < FLYING)
    rate = 1.0 / airframe.step
    return (
        moved,
        times(rate, plus(moved[1], -1.0, motion[1])),
        times(rate, plus(moved[3], -1.0, motion[3])),
        (chosen(idle, still, known[0]), chosen(idle, still, known[1])),
        where(standing, 1.0, 0.0),
    )


@kernel
def advance(
    state: FloatArray,
    command: FloatArray,
    airframe: Airframe,
    steps: int,
    commanded: FloatArray,
    track: FloatArray,
) -> None:
    """Advance a state row, or a block, by ``steps`` steps; ``track`` (3 steps,) receives the positions."""
    attitude = (at(state, 6), at(state, 7), at(state, 8), at(state, 9))
    motion = (three_at(state, 0), three_at(state, 3), attitude, three_at(state, 10))
    acceleration, angular_acceleration = three_at(state, 13), three_at(state, 16)
    landed = at(state, LANDED)
    known = (three_at(state, 20), three_at(state, 23))
    n = airframe.rotor_x.size
    speeds, left = state[STATE_SIZE : STATE_SIZE + n], state[STATE_SIZE + n :]
    for i in range(steps):
        command_motors(motion, acceleration, known, command, i * airframe.step, airframe, commanded)
        motion, acceleration, angular_acceleration, known, landed = physics_step(
            motion,
            acceleration,
            angular_acceleration,
            known,
            command,
            speeds,
            left,
            commanded,
            airframe,
        )
        put_three(track, 3 * i, motion[0])
    put_three(state, 0, motion[0])
    put_three(state, 3, motion[1])
    for j in range(4):
        put(state, 6 + j, motion[2][j])
    put_three(state, 10, motion[3])
    put_three(state, 13, acceleration)
    put_three(state, 16, angular_acceleration)
    put(state, LANDED, landed)
    put_three(state, 20, known[0])
    put_three(state, 23, known[1])
