"""Geometric tracking controller of Lee, Leok and McClamroch (CDC 2010) with complete feed-forward.

Notation of the paper, e3 down: A is the force, apart from gravity, that the vehicle should receive, and
b3c = −A/‖A‖. Added to the paper: A can contain terms that cancel the rotor drag at zero wind (after Faessler,
Franchi and Scaramuzza, 2018: a drag linear in velocity) and the disturbance estimated by ``observer``, and A
can be limited to a greatest tilt.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sitl.vehicle.angles import cosine_sine
from sitl.vehicle.compiled import kernel
from sitl.vehicle.derivatives import WithRates, across_with_rates, cross_with_rates, unit_with_rates
from sitl.vehicle.observer import Disturbance, drag_moment
from sitl.vehicle.simd import some, where
from sitl.vehicle.vectors import (
    Axes,
    Vector,
    chosen,
    cross,
    dot,
    greatest,
    least,
    plus,
    scaled,
    times,
    to_body,
    to_ned,
)

if TYPE_CHECKING:
    from sitl.vehicle.airframe import Airframe

Trajectory = tuple[Vector, Vector, Vector, Vector, Vector]
"""x_d and its first four derivatives (m, NED)."""

_UPRIGHT_NOSE = 0.02
"""Sine of the angle between b3c and b1d (or b1d's right) below which there is no heading."""


@kernel
def limited_force(A: Vector, airframe: Airframe) -> tuple[Vector, bool]:
    """Return A within the greatest tilt and the thrust of the rotors, and whether that changed it.

    Height has priority: the upward part lies between the least lift and full thrust of all rotors; the
    horizontal part keeps its direction and is limited to what the tilt and the thrust then leave.
    """
    up = greatest(airframe.min_lift, least(airframe.max_lift, -A[2]))
    square = A[0] * A[0] + A[1] * A[1]
    tilted, lift = airframe.tan_max_tilt * up, airframe.max_lift
    room = least(tilted * tilted, lift * lift - up * up)
    wide = square > room
    limited = wide | (up > -A[2]) | (up < -A[2])
    if some(limited):
        part = where(wide, math.sqrt(room / square), 1.0)
        A = (part * A[0], part * A[1], -up)
    return A, limited


@kernel
def limited_nose(yaw: float, axes: Axes, airframe: Airframe) -> Vector:
    """Return b1d = (cos ψ, sin ψ, 0) for a yaw ψ (rad), limited to the greatest yaw error.

    Beyond it b1d is the heading at the greatest yaw error from the nose, on the shorter side: beyond a right
    angle e_R would misdirect roll and pitch while a vehicle with weak yaw control turns slowly.
    """
    ahead, right = cosine_sine(yaw)
    x, y = axes[0][0], axes[0][1]
    level = math.sqrt(x * x + y * y)
    far = ahead * x + right * y < airframe.cos_max_yaw_error * level
    if some(far):
        cosine, sine = airframe.cos_max_yaw_error, airframe.sin_max_yaw_error
        sine = where(x * right - y * ahead >= 0.0, sine, -sine)
        ahead = where(far, (x * cosine - y * sine) / level, ahead)
        right = where(far, (y * cosine + x * sine) / level, right)
    return (ahead, right, 0.0)


@kernel
def commanded_attitude(
    A: WithRates,
    nose: Vector,
    yaw_rate: float,
    yaw_acceleration: float,
    axes: Axes,
    airframe: Airframe,
) -> tuple[Axes, Vector, Vector]:
    """Return R_c, Ω_c and Ω̇_c from A and its derivatives, and from b1d (``nose``) and the derivatives of ψ.

    The paper takes b2c normal to b1d, which turns the nose of a tilted vehicle away from ψ by up to about
    half the square of its tilt (rad). With ``euler_heading`` b1c instead lies in the vertical plane of b1d,
    so that ψ is the yaw of MAVLink. If A nearly vanishes, b3c is the present b3, without rates of change. If
    b3c is nearly along b1d (with ``euler_heading``: along b1d's right), there is no heading to follow: the
    nose keeps its direction, and Ω_c and Ω̇_c are zero.
    """
    still = (0.0, 0.0, 0.0)
    down = (times(-1.0, A[0]), times(-1.0, A[1]), times(-1.0, A[2]))
    weightless = dot(A[0], A[0]) <= airframe.weightless * airframe.weightless
    if some(weightless):
        down = (
            chosen(weightless, axes[2], down[0]),
            chosen(weightless, still, down[1]),
            chosen(weightless, still, down[2]),
        )
    b3 = unit_with_rates(down)
    aside = (-nose[1], nose[0], 0.0)
    inward = -yaw_rate * yaw_rate
    if airframe.euler_heading:
        turning = plus(times(inward, aside), -yaw_acceleration, nose)
        C = across_with_rates((aside, times(-yaw_rate, nose), turning), b3)
    else:
        turning = plus(times(inward, nose), yaw_acceleration, aside)
        C = cross_with_rates(b3, (nose, times(yaw_rate, aside), turning))
    upright = dot(C[0], C[0]) <= _UPRIGHT_NOSE * _UPRIGHT_NOSE
    if some(upright):
        # At most one of the vehicle's present axes axes[0] and axes[1] can be along b3c.
        side = cross(b3[0], axes[0])
        along = dot(side, side) < _UPRIGHT_NOSE * _UPRIGHT_NOSE
        side = chosen(along, plus(axes[1], -dot(axes[1], b3[0]), b3[0]), side)
        b3 = (b3[0], chosen(upright, still, b3[1]), chosen(upright, still, b3[2]))
        C = (chosen(upright, side, C[0]), chosen(upright, still, C[1]), chosen(upright, still, C[2]))
    b2 = unit_with_rates(C)
    b1 = cross(b2[0], b3[0])
    wx, wy, wz = dot(b3[0], b2[1]), dot(b1, b3[1]), -dot(b1, b2[1])
    # From ḃ1 = wz b2 − wy b3 and the corresponding equations of the others.
    rates_change = (
        dot(b3[0], b2[2]) - wy * wz,
        dot(b1, b3[2]) - wz * wx,
        wx * wy - dot(b1, b2[2]),
    )
    return (b1, b2[0], b3[0]), (wx, wy, wz), rates_change


@kernel
def desired_force(
    position: Vector,
    velocity: Vector,
    acceleration: Vector,
    axes: Axes,
    rates: Vector,
    target: Trajectory,
    disturbance: Vector,
    airframe: Airframe,
) -> tuple[float, WithRates]:
    """Return the thrust f (N) and A with its first two derivatives.

    A = −k_x e_x − k_v e_v − m g e3 + m ẍ_d + D ẋ_d − d with the known disturbance d (N, NED), and f = −(A − D
    ẋ_d)·b3. D (N s/m) is the coefficient of the cancelled drag, −D v⊥ = −D v + D (v·b3) b3: D ẋ_d in A
    cancels the first term; the second is along the thrust. If A is limited, f is at least 0, and where A was
    changed its derivatives are zero. The derivatives use the measured acceleration instead of the paper's
    modelled one, which would be permanently wrong in a steady wind, and the jerk of the model.
    """
    m, k_x, k_v, D = airframe.mass, airframe.k_x, airframe.k_v, airframe.cancelled_drag
    b3 = axes[2]
    db3 = to_ned(axes, (rates[1], -rates[0], 0.0))
    e_x, e_v = plus(position, -1.0, target[0]), plus(velocity, -1.0, target[1])
    B = plus(plus(times(m, target[2]), -k_x, e_x), -k_v, e_v)
    B = plus((B[0], B[1], B[2] - m * airframe.gravity), -1.0, disturbance)
    A = plus(B, D, target[1])
    f = -dot(B, b3)
    e_a = plus(acceleration, -1.0, target[2])
    dB = plus(plus(times(m, target[3]), -k_x, e_v), -k_v, e_a)
    df = -dot(dB, b3) - dot(B, db3)
    sliding = plus(acceleration, -dot(acceleration, b3) - dot(velocity, db3), b3)
    sliding = plus(sliding, -dot(velocity, b3), db3)
    jerk = plus(plus(times(-df / m, b3), -f / m, db3), -D / m, sliding)
    ddB = plus(plus(times(m, target[4]), -k_x, e_a), -k_v, plus(jerk, -1.0, target[3]))
    dA, ddA = plus(dB, D, target[2]), plus(ddB, D, target[3])
    if airframe.limits_force:
        A, limited = limited_force(A, airframe)
        if some(limited):
            still = (0.0, 0.0, 0.0)
            f = where(limited, -dot(plus(A, -D, target[1]), b3), f)
            dA, ddA = chosen(limited, still, dA), chosen(limited, still, ddA)
        f = greatest(f, 0.0)
    return f, (A, dA, ddA)


@kernel
def attitude_errors(axes: Axes, commanded: Axes, commanded_rates: Vector) -> tuple[Vector, Vector]:
    """Return e_R = ½(R_cᵀR − RᵀR_c)^∨ and RᵀR_cΩ_c, the commanded rates in the body's own axes."""
    x, y, z = to_body(commanded, axes[0]), to_body(commanded, axes[1]), to_body(commanded, axes[2])
    e_R = (0.5 * (y[2] - z[1]), 0.5 * (z[0] - x[2]), 0.5 * (x[1] - y[0]))
    return e_R, to_body(axes, to_ned(commanded, commanded_rates))


@kernel
def control(
    position: Vector,
    velocity: Vector,
    acceleration: Vector,
    axes: Axes,
    rates: Vector,
    target: Trajectory,
    yaw: float,
    yaw_rate: float,
    yaw_acceleration: float,
    disturbance: Disturbance,
    airframe: Airframe,
) -> tuple[float, Vector]:
    """Return thrust f (N, along −b3) and moment M (N m, body) that track a trajectory (NED) and a yaw (rad).

    M = −k_R e_R − k_Ω e_Ω + Ω×JΩ − J(Ω̂RᵀR_cΩ_c − RᵀR_cΩ̇_c), Ω̂ being the cross product with Ω, less the
    cancelled moments of the rotors (``drag_moment``: drag at their height, rolling moment, drag against the
    yaw rate) and that of the known ``disturbance``. Without ``rate_feed_forward`` Ω_c and Ω̇_c are zero.
    """
    f, A = desired_force(position, velocity, acceleration, axes, rates, target, disturbance[0], airframe)
    nose = limited_nose(yaw, axes, airframe)
    commanded, rates_c, rates_change = commanded_attitude(A, nose, yaw_rate, yaw_acceleration, axes, airframe)
    rates_c = times(airframe.rate_feed_forward, rates_c)
    rates_change = times(airframe.rate_feed_forward, rates_change)
    e_R, followed = attitude_errors(axes, commanded, rates_c)
    e_Omega = plus(rates, -1.0, followed)
    J = (airframe.inertia[0], airframe.inertia[1], airframe.inertia[2])
    k_R = (airframe.k_R[0], airframe.k_R[1], airframe.k_R[2])
    k_Omega = (airframe.k_Omega[0], airframe.k_Omega[1], airframe.k_Omega[2])
    M = plus(times(-1.0, scaled(k_R, e_R)), -1.0, scaled(k_Omega, e_Omega))
    M = plus(M, 1.0, cross(rates, scaled(J, rates)))
    turning = plus(cross(rates, followed), -1.0, to_body(axes, to_ned(commanded, rates_change)))
    M = plus(M, 1.0, drag_moment(to_body(commanded, target[1]), followed[2], airframe))
    M = plus(M, -1.0, disturbance[1])
    return f, plus(M, -1.0, scaled(J, turning))
