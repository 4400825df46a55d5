"""Many steps of many vehicles of one type in one compiled call:

reference → controller → allocation → rotors → body → ground → position.

Rows are float64. A *state* row has STATE_SIZE + n columns: position 0:3, velocity 3:6 (m, m/s, NED), attitude
6:10 (w, x, y, z, body to NED), body rates 10:13 (rad/s, FRD), acceleration 13:16 (m/s², NED) and angular
acceleration 16:19 (rad/s², FRD), both means of the last step, 19 is 1 when it stands on the ground, then the
n rotor speeds (rad/s). A *command* row has COMMAND_SIZE columns: mode 0, the reference's position, velocity,
acceleration, jerk, snap 1:16 (NED), yaw, yaw rate and yaw acceleration 16:19, wind 19:22 (m/s, NED, where the
air goes), z of the ground 22 (m, NED).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from sitl.allocation import allocate
from sitl.body import Motion, body_axes, free_flight, turned
from sitl.compiled import entry, kernel, sources_digest
from sitl.controller import Trajectory, control
from sitl.environment import ground_contact
from sitl.rotors import half_step, wrench
from sitl.vectors import Vector, plus, times, to_body

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sitl.airframe import Airframe, FloatArray

STATE_SIZE = 20
LANDED = 19
COMMAND_SIZE = 23
STOPPED, IDLE, FLYING = 0.0, 1.0, 2.0
"""Modes: motors off; rotors turning slowly; following the reference."""


@kernel
def vector_at(row: FloatArray, column: int) -> Vector:
    """Three columns of a row."""
    return (row[column], row[column + 1], row[column + 2])


@kernel
def extrapolated(row: FloatArray, t: float) -> Trajectory:
    """The reference of a command row ``t`` seconds on: its Taylor polynomial with all its derivatives."""
    x, v, a = vector_at(row, 1), vector_at(row, 4), vector_at(row, 7)
    j, s = vector_at(row, 10), vector_at(row, 13)
    return (
        plus(x, t, plus(v, t / 2.0, plus(a, t / 3.0, plus(j, t / 4.0, s)))),
        plus(v, t, plus(a, t / 2.0, plus(j, t / 3.0, s))),
        plus(a, t, plus(j, t / 2.0, s)),
        plus(j, t, s),
        s,
    )


@kernel
def commanded_speeds(
    motion: Motion,
    acceleration: Vector,
    command: FloatArray,
    t: float,
    airframe: Airframe,
    commanded: FloatArray,
) -> None:
    """Write the rotor speeds (n,) (rad/s) that are asked of the motors ``t`` seconds into a command."""
    if command[0] != FLYING:
        commanded[:] = airframe.omega_idle if command[0] == IDLE else 0.0
        return
    position, velocity, attitude, rates = motion
    yaw_rate, yaw_acceleration = command[17], command[18]
    thrust, moment = control(
        position,
        velocity,
        acceleration,
        body_axes(attitude),
        rates,
        extrapolated(command, t),
        command[16] + t * (yaw_rate + 0.5 * t * yaw_acceleration),
        yaw_rate + t * yaw_acceleration,
        yaw_acceleration,
        airframe,
    )
    allocate(thrust, moment, airframe, commanded)


@kernel
def physics_step(
    motion: Motion,
    acceleration: Vector,
    angular_acceleration: Vector,
    command: FloatArray,
    speeds: FloatArray,
    commanded: FloatArray,
    airframe: Airframe,
) -> tuple[Motion, Vector, Vector, bool]:
    """One step with the motors held at ``commanded``; moves the rotor ``speeds`` in place.

    The rotors' wrench is that of the middle of the step: rotor speeds are exact there, body rates and the
    velocity through the air are carried there by the accelerations of the last step.
    """
    half_step(speeds, commanded, airframe)
    wind = vector_at(command, 19)
    half = 0.5 * airframe.step
    middle_velocity = plus(motion[1], half, acceleration)
    middle_rates = plus(motion[3], half, angular_acceleration)
    middle_axes = body_axes(turned(motion[2], times(half, motion[3])))
    air_velocity = to_body(middle_axes, plus(middle_velocity, -1.0, wind))
    force, moment = wrench(speeds, air_velocity, middle_rates, airframe)
    half_step(speeds, commanded, airframe)
    moved = free_flight(motion, force, moment, airframe)
    moved, landed = ground_contact(motion, moved, command[22], airframe)
    rate = 1.0 / airframe.step
    return (
        moved,
        times(rate, plus(moved[1], -1.0, motion[1])),
        times(rate, plus(moved[3], -1.0, motion[3])),
        landed,
    )


@kernel
def advance_one(
    state: FloatArray,
    command: FloatArray,
    airframe: Airframe,
    steps: int,
    commanded: FloatArray,
    track: FloatArray,
) -> None:
    """Carry one state row through all ``steps``; ``track`` (steps, 3) gets the position after each."""
    attitude = (state[6], state[7], state[8], state[9])
    motion = (vector_at(state, 0), vector_at(state, 3), attitude, vector_at(state, 10))
    acceleration, angular_acceleration = vector_at(state, 13), vector_at(state, 16)
    landed = state[LANDED] != 0.0
    speeds = state[STATE_SIZE:]
    for i in range(steps):
        commanded_speeds(motion, acceleration, command, i * airframe.step, airframe, commanded)
        motion, acceleration, angular_acceleration, landed = physics_step(
            motion, acceleration, angular_acceleration, command, speeds, commanded, airframe
        )
        track[i, 0], track[i, 1], track[i, 2] = motion[0]
    state[0], state[1], state[2] = motion[0]
    state[3], state[4], state[5] = motion[1]
    state[6], state[7], state[8], state[9] = motion[2]
    state[10], state[11], state[12] = motion[3]
    state[13], state[14], state[15] = acceleration
    state[16], state[17], state[18] = angular_acceleration
    state[LANDED] = 1.0 if landed else 0.0


def _build(digest: int) -> Callable[[FloatArray, FloatArray, NDArray[np.void], int, FloatArray], int]:
    @entry
    def advance_rows(
        states: FloatArray,
        commands: FloatArray,
        airframes: NDArray[np.void],
        steps: int,
        tracks: FloatArray,
    ) -> int:
        _ = digest  # in the closure, and so in the key of numba's cache
        for k in range(states.shape[0]):
            if not np.isfinite(np.sum(commands[k])):
                return k
        commanded = np.empty(states.shape[1] - STATE_SIZE)
        for k in range(states.shape[0]):
            advance_one(states[k], commands[k], airframes[0], steps, commanded, tracks[k])
        return -1

    return advance_rows


advance_rows = _build(
    sources_digest(
        "vectors.py",
        "body.py",
        "rotors.py",
        "allocation.py",
        "controller.py",
        "environment.py",
        "pipeline.py",
    )
)
"""Compiled. Takes states (K, STATE_SIZE + n), commands (K, COMMAND_SIZE), the airframe record (1,), the
number of steps and tracks (K, steps, 3). Changes states and tracks in place and returns −1; or returns the
index of a command row that is not finite, having changed nothing. All arrays are C-contiguous float64. A
vehicle's result does not depend on the others of its batch.
"""
