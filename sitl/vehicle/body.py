"""Rigid body: Newton and Euler in a flat NED frame, and the split integrator.

Body axes forward, right, down; Hamilton quaternions (w, x, y, z) that take body coordinates to NED; SI.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sitl.vehicle.angles import cosine_sine, small_cosine_sinc
from sitl.vehicle.compiled import kernel
from sitl.vehicle.simd import some, where
from sitl.vehicle.vectors import Axes, Vector, cross, dot, plus, scaled, times, to_ned

if TYPE_CHECKING:
    from sitl.vehicle.airframe import Airframe

Quaternion = tuple[float, float, float, float]

Motion = tuple[Vector, Vector, Quaternion, Vector]
"""Position (m, NED), velocity (m/s, NED), attitude (body to NED), body rates Ω (rad/s, FRD)."""


@kernel
def body_axes(q: Quaternion) -> Axes:
    """Return the columns of R(q): the body axes in NED."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@kernel
def turned(q: Quaternion, rotation: Vector) -> Quaternion:
    """Return q ⊗ exp(rotation / 2): the attitude after a rotation vector (rad, body axes)."""
    half = times(0.5, rotation)
    square = dot(half, half)
    c, s = small_cosine_sinc(square)
    large = square > 0.01
    if some(large):
        angle = math.sqrt(square)
        cosine, sine = cosine_sine(angle)
        c, s = where(large, cosine, c), where(large, sine / angle, s)
    w, x, y, z = q
    ex, ey, ez = times(s, half)
    return (
        w * c - x * ex - y * ey - z * ez,
        w * ex + x * c + y * ez - z * ey,
        w * ey - x * ez + y * c + z * ex,
        w * ez + x * ey - y * ex + z * c,
    )


@kernel
def normalised(q: Quaternion) -> Quaternion:
    """Return q / ‖q‖ for a q with rounding errors only: one Newton step, without a root."""
    w, x, y, z = q
    s = 1.5 - 0.5 * (w * w + x * x + y * y + z * z)
    return (s * w, s * x, s * y, s * z)


@kernel
def angular_acceleration(rates: Vector, moment: Vector, airframe: Airframe) -> Vector:
    """Return J⁻¹(M − Ω×JΩ), Euler's equation: the gyroscopic torque is normal to Ω and does no work."""
    J = (airframe.inertia[0], airframe.inertia[1], airframe.inertia[2])
    torque = plus(moment, -1.0, cross(rates, scaled(J, rates)))
    return (torque[0] / J[0], torque[1] / J[1], torque[2] / J[2])


@kernel
def free_flight(motion: Motion, force_body: Vector, moment: Vector, airframe: Airframe) -> Motion:
    """Advance one physics step under constant force (N, body) and moment (N m, body), and gravity.

    The split step is of second order: the body rate at the middle of the step, then the exact quaternion
    exponential of that rate, then the force rotated by the attitude at the middle.
    """
    position, velocity, attitude, rates = motion
    h = airframe.step
    middle_rates = plus(rates, 0.5 * h, angular_acceleration(rates, moment, airframe))
    half_turn = times(0.5 * h, middle_rates)
    middle_attitude = turned(attitude, half_turn)
    acceleration = times(1.0 / airframe.mass, to_ned(body_axes(middle_attitude), force_body))
    acceleration = plus(acceleration, airframe.gravity, (0.0, 0.0, 1.0))
    return (
        plus(plus(position, h, velocity), 0.5 * h * h, acceleration),
        plus(velocity, h, acceleration),
        normalised(turned(middle_attitude, half_turn)),
        plus(rates, h, angular_acceleration(middle_rates, moment, airframe)),
    )
