"""Compiled part of the JSBSim backend: JSBSim's measurements → state row → commanded speeds of the motors.

Rows are those of ``sitl.vehicle.pipeline``; controller, allocation and observer are its kernels. A *place*
row has 12 columns: the origin of the site 0:3 (m, earth-centred, earth-fixed) and, row by row, the rotation
3:12 from those axes to the site's NED. A *measured* row is that of ``jsbsim_engine``.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sitl.backends.jsbsim_model import FOOT, POUND
from sitl.vehicle.airframe import FloatArray
from sitl.vehicle.body import Quaternion
from sitl.vehicle.compiled import FLIGHT_SOURCES, entry, kernel, sources_digest
from sitl.vehicle.observer import observed
from sitl.vehicle.pipeline import FLYING, LANDED, STATE_SIZE, command_motors
from sitl.vehicle.rotors import wrench
from sitl.vehicle.simd import put_three, three_at
from sitl.vehicle.vectors import Axes, Vector, plus, times, to_body, to_ned


@kernel
def ned_rows(latitude: float, longitude: float) -> Axes:
    """Return north, east and down (in ECEF) at a geodetic latitude and a longitude (rad)."""
    sa, ca, so, co = math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude)
    return ((-sa * co, -sa * so, ca), (-so, co, 0.0), (-ca * co, -ca * so, -sa))


@kernel
def euler_rows(roll: float, pitch: float, yaw: float) -> Axes:
    """Return the rows of the rotation from NED to body axes (FRD), the body axes in NED; angles in rad."""
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    sy, cy = math.sin(yaw), math.cos(yaw)
    return (
        (cp * cy, cp * sy, -sp),
        (sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp),
        (cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp),
    )


@kernel
def quaternion(axes: Axes) -> Quaternion:
    """Return the attitude (w, x, y, z) with these body axes in NED; by its largest element (Shepperd)."""
    b1, b2, b3 = axes
    w = 1.0 + b1[0] + b2[1] + b3[2]
    x = 1.0 + b1[0] - b2[1] - b3[2]
    y = 1.0 - b1[0] + b2[1] - b3[2]
    z = 1.0 - b1[0] - b2[1] + b3[2]
    if w >= max(x, y, z):
        q = (w, b2[2] - b3[1], b3[0] - b1[2], b1[1] - b2[0])
    elif x >= max(y, z):
        q = (b2[2] - b3[1], x, b1[1] + b2[0], b3[0] + b1[2])
    elif y >= z:
        q = (b3[0] - b1[2], b1[1] + b2[0], y, b2[2] + b3[1])
    else:
        q = (b1[1] - b2[0], b3[0] + b1[2], b2[2] + b3[1], z)
    size = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (size * q[0], size * q[1], size * q[2], size * q[3])


@kernel
def motion_of(measured: FloatArray, place: FloatArray) -> tuple[Vector, Vector, Axes, Vector]:
    """Return the measured motion in the site's NED.

    The result is position (m), velocity (m/s), body axes and body rates (rad/s).
    """
    site = (three_at(place, 3), three_at(place, 6), three_at(place, 9))
    position = to_body(site, plus(times(FOOT, three_at(measured, 0)), -1.0, three_at(place, 0)))
    velocity = to_body(site, times(FOOT, three_at(measured, 3)))
    local = ned_rows(measured[9], measured[10])
    b1, b2, b3 = euler_rows(measured[6], measured[7], measured[8])
    axes = (
        to_body(site, to_ned(local, b1)),
        to_body(site, to_ned(local, b2)),
        to_body(site, to_ned(local, b3)),
    )
    return position, velocity, axes, three_at(measured, 11)


_Steer = Callable[[FloatArray, FloatArray, NDArray[np.void], float, FloatArray], None]
_Sense = Callable[[FloatArray, FloatArray, FloatArray, FloatArray, NDArray[np.void]], bool]


def _build(digest: int) -> tuple[_Steer, _Sense]:
    # The digest is in the closures, and so in the keys of numba's cache.
    @entry
    def compiled_steer(
        state: FloatArray,
        command: FloatArray,
        airframes: NDArray[np.void],
        t: float,
        commanded: FloatArray,
    ) -> None:
        _ = digest
        attitude = (state[6], state[7], state[8], state[9])
        motion = (three_at(state, 0), three_at(state, 3), attitude, three_at(state, 10))
        known = (three_at(state, 20), three_at(state, 23))
        command_motors(motion, three_at(state, 13), known, command, t, airframes[0], commanded)

    @entry
    def compiled_sense(
        state: FloatArray,
        measured: FloatArray,
        place: FloatArray,
        command: FloatArray,
        airframes: NDArray[np.void],
    ) -> bool:
        _ = digest
        if not np.isfinite(np.sum(measured)):
            return False
        airframe = airframes[0]
        n = airframe.rotor_x.size
        position, velocity, axes, rates = motion_of(measured, place)
        rate = 1.0 / airframe.step
        put_three(state, 13, times(rate, plus(velocity, -1.0, three_at(state, 3))))
        put_three(state, 16, times(rate, plus(rates, -1.0, three_at(state, 10))))
        put_three(state, 0, position)
        put_three(state, 3, velocity)
        state[6:10] = quaternion(axes)
        put_three(state, 10, rates)
        state[LANDED] = 1.0 if measured[20] != 0.0 else 0.0
        speeds, left = state[STATE_SIZE : STATE_SIZE + n], state[STATE_SIZE + n :]
        for i in range(n):
            speeds[i] = measured[21 + i]
        still = (0.0, 0.0, 0.0)
        if state[LANDED] == 1.0 or command[0] < FLYING:
            put_three(state, 20, still)
            put_three(state, 23, still)
            return True
        _, _, intact_thrust, intact_moment = wrench(speeds, left, still, still, airframe)
        known, turn = observed(
            (three_at(state, 20), three_at(state, 23)),
            times(POUND, three_at(measured, 14)),
            times(POUND * FOOT, three_at(measured, 17)),
            intact_thrust,
            intact_moment,
            to_body(axes, velocity),
            rates,
            axes,
            airframe,
        )
        put_three(state, 20, known)
        put_three(state, 23, turn)
        return True

    return compiled_steer, compiled_sense


_steer, _sense = _build(
    sources_digest(*FLIGHT_SOURCES, "../backends/jsbsim_model.py", "../backends/jsbsim_pilot.py")
)


def steer(
    state: FloatArray, command: FloatArray, airframes: NDArray[np.void], t: float, commanded: FloatArray
) -> None:
    """Write the motors' commanded speeds (n,) (rad/s), ``t`` seconds after the start of a command row.

    ``airframes`` (1,) is the record of ``airframe_record``.
    """
    _steer(state, command, airframes, t, commanded)


def sense(
    state: FloatArray,
    measured: FloatArray,
    place: FloatArray,
    command: FloatArray,
    airframes: NDArray[np.void],
) -> bool:
    """Update a state row from the ``measured`` row after a step under a command row.

    ``place`` is a place row. Return False, and change nothing, if the measured row is not finite.
    """
    return _sense(state, measured, place, command, airframes)
