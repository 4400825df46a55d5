"""Constants of one type of vehicle, as the compiled steps read them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.allocation import effectiveness
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.ground import GRAVITY

FloatArray = NDArray[np.float64]

_WEIGHTLESS = 1e-3
"""Ratio of ‖A‖ to weight below which A, the force that ``controller`` requests, has no direction."""


class Airframe(NamedTuple):
    """Constants derived once from a ``VehicleConfig``; n rotors, SI, body axes forward-right-down.

    Compiled code reads the same names from the record that ``airframe_record`` packs.
    """

    step: float  # s
    gravity: float  # m/s²
    mass: float  # kg
    inertia: FloatArray  # (3,) kg m², the diagonal of J
    rotor_x: FloatArray  # (n,) m
    rotor_y: FloatArray  # (n,) m
    rotor_z: FloatArray  # (n,) m
    rotor_spin: FloatArray  # (n,) +1 counter-clockwise seen from above, −1 clockwise
    k_f: float  # N s²/rad²
    k_m: float  # m
    rotor_drag: float  # kg/rad
    rolling_moment: float  # kg m/rad
    half_step_decay_up: float  # remaining part, after half a step, of the distance to a higher speed
    half_step_decay_down: float
    omega_idle: float  # rad/s
    min_thrust: float  # N, one rotor
    max_thrust: float  # N, one rotor
    speed_squared: float  # rad²/s² per N of a rotor
    mixer: FloatArray  # (n, 4) from thrust and moments to rotor thrusts
    rotor_share: FloatArray  # (n,) total thrust over that of each rotor in hover
    k_x: float  # N/m
    k_v: float  # N s/m
    k_R: FloatArray  # (3,) N m  # noqa: N815
    k_Omega: FloatArray  # (3,) N m s  # noqa: N815
    rate_feed_forward: float  # 1 or 0
    euler_heading: bool
    cancelled_drag: float  # N s/m, D of the controller
    cancelled_drag_arm: float  # N s, D times the mean height z of the rotors
    cancelled_rolling: float  # N s, the rolling moment over velocity
    cancelled_turning: float  # N m s, moment of the rotor drag against a yaw rate
    limits_force: bool
    tan_max_tilt: float
    cos_max_yaw_error: float
    sin_max_yaw_error: float
    weightless: float  # N, ‖A‖ below which A has no direction
    min_lift: float  # N, all rotors
    max_lift: float  # N, all rotors
    force_learnt: float  # share of the remaining force error that the observer corrects in a step
    moment_learnt: float
    max_disturbance_force: float  # N
    max_disturbance_moment: FloatArray  # (3,) N m
    rest_height: float  # m
    gear_radius: float  # m
    ground_friction: float


def airframe(config: VehicleConfig, gravity: float = GRAVITY) -> Airframe:
    """Return the constants of ``config`` for the compiled steps; ``gravity`` in m/s²."""
    x, y, z = np.ascontiguousarray(np.array([rotor.position for rotor in config.rotors]).T)
    spin = np.array([rotor.spin_sign for rotor in config.rotors])
    n = len(config.rotors)
    step = config.physics_period * 1e-6
    weight = config.mass * gravity
    max_thrust = config.k_f * config.omega_max**2
    cancelled_speeds = config.drag_feed_forward * math.sqrt(n * weight / config.k_f)
    max_yaw_error = math.pi if config.max_yaw_error_deg is None else math.radians(config.max_yaw_error_deg)
    mixer = np.asarray(np.linalg.pinv(effectiveness(x, y, spin, config.k_m)), dtype=np.float64)
    return Airframe(
        step=step,
        gravity=gravity,
        mass=config.mass,
        inertia=np.array(config.inertia),
        rotor_x=x,
        rotor_y=y,
        rotor_z=z,
        rotor_spin=spin,
        k_f=config.k_f,
        k_m=config.k_m,
        rotor_drag=config.rotor_drag,
        rolling_moment=config.rolling_moment,
        half_step_decay_up=math.exp(-0.5 * step / config.tau_up),
        half_step_decay_down=math.exp(-0.5 * step / config.tau_down),
        omega_idle=config.omega_idle,
        min_thrust=config.k_f * config.omega_idle**2,
        max_thrust=max_thrust,
        speed_squared=1.0 / config.k_f,
        mixer=mixer,
        rotor_share=1.0 / mixer[:, 0],
        k_x=config.k_x,
        k_v=config.k_v,
        k_R=np.array(config.k_R),
        k_Omega=np.array(config.k_Omega),
        rate_feed_forward=1.0 if config.rate_feed_forward else 0.0,
        euler_heading=config.heading == "euler",
        cancelled_drag=config.rotor_drag * cancelled_speeds,
        cancelled_drag_arm=config.rotor_drag * cancelled_speeds * float(np.mean(z)),
        cancelled_rolling=config.rolling_moment * cancelled_speeds,
        cancelled_turning=config.rotor_drag * cancelled_speeds * float(np.mean(x * x + y * y)),
        limits_force=config.max_tilt_deg is not None,
        tan_max_tilt=math.tan(math.radians(config.max_tilt_deg or 0.0)),
        cos_max_yaw_error=math.cos(max_yaw_error),
        sin_max_yaw_error=math.sin(max_yaw_error),
        weightless=_WEIGHTLESS * weight,
        min_lift=config.min_lift * weight,
        max_lift=n * max_thrust,
        force_learnt=-math.expm1(-config.disturbance_force_rate * step),
        moment_learnt=-math.expm1(-config.disturbance_moment_rate * step),
        max_disturbance_force=config.max_disturbance_force * weight,
        max_disturbance_moment=np.array(config.max_disturbance_moment),
        rest_height=config.rest_height,
        gear_radius=config.gear_radius,
        ground_friction=config.ground_friction,
    )


def hover_speeds(config: VehicleConfig, gravity: float = GRAVITY) -> FloatArray:
    """Return the rotor speeds (n,) (rad/s) that carry the weight without a moment; ``gravity`` in m/s²."""
    numbers = airframe(config, gravity)
    return np.sqrt(config.mass * gravity * numbers.mixer[:, 0] * numbers.speed_squared)


def airframe_record(numbers: Airframe) -> NDArray[np.void]:
    """Return the constants as a read-only structured array (1,), which numba passes without unpacking."""
    fields: list[tuple[str, Any, tuple[int, ...]]] = [
        (name, np.asarray(value).dtype, np.shape(value)) for name, value in numbers._asdict().items()
    ]
    record = np.zeros(1, dtype=np.dtype(fields, align=True))
    for name, value in numbers._asdict().items():
        record[name] = value
    record.flags.writeable = False
    return record
