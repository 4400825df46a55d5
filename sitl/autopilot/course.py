"""References of the controller: the guidance's motion with its jerk, in terms of the estimate.

An autopilot closes its position loop on its estimate. The physics closes it on the truth, to the bit; so the
estimate's error is subtracted from the reference instead. For an estimate x̂ = x + e the loop that drives x̂
− x_d to zero is the one that drives x − (x_d − e) to zero: with position, velocity and yaw so shifted the
vehicle flies exactly as if the controller had received the estimate. A wrong attitude tilts the thrust that
was meant to be vertical, which is an acceleration: to first order −θ × (a − g), θ being the attitude error as
a rotation vector and a − g the requested specific force. Body rates are not shifted: the noise of the rate
loop's gyros lies far above the motors' bandwidth, and their bias is part of the yaw error.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple, Self

import numpy as np

from mavlink_bridge.messages import Vector
from sitl.autopilot.guidance import Activity, Guidance
from sitl.estimation.sensors import Deviation
from sitl.values.origin import Origin
from sitl.values.setpoints import ZERO
from sitl.vehicle.airframe import FloatArray, airframe
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.ground import GRAVITY
from sitl.vehicle.multirotor import Reference, VehicleState

_JERK_TIME: Final = 0.1
"""Time constant of the jerk that is derived from a stream of accelerations (s)."""
_TURN_TIME: Final = 0.03
"""Time constant of the yaw acceleration that is derived from a stream of yaw rates (s)."""


class Course:
    """Generator of references (site NED) from the guidance (local NED).

    Set-points carry neither jerk nor yaw acceleration. Without jerk the controller does not anticipate
    rotation of the thrust axis and lags in curves; without yaw acceleration a weak yaw control lags in every
    turn. Both are derived from the motion, low-pass filtered so that a step does not cause a jolt.
    """

    def __init__(self, guidance: Guidance, origin: Origin) -> None:
        self._guidance = guidance
        self._origin = origin
        self._elapsed = 0
        self._shares = (0, 0.0, 0.0)
        self._acceleration = self._jerk = ZERO
        self._yaw_rate = self._turning = 0.0

    @property
    def reference(self) -> Reference | None:
        """Requested reference, without the derivatives that are computed from it; None if there is none.

        With a firmware's response the motion lags behind it.
        """
        guidance = self._guidance
        if guidance.activity is Activity.IDLE:
            return None
        motion = self._origin.motion_to_site(guidance.commanded)
        yaw = guidance.yaw + self._origin.turn
        return Reference(motion[0], motion[1], motion[2], yaw=yaw, yaw_rate=guidance.yaw_rate)

    def next(self, step: int) -> Reference | None:
        """Return the reference of the next ``step`` µs, once all earlier ones have been flown."""
        guidance, origin = self._guidance, self._origin
        if guidance.activity is Activity.IDLE:
            self._elapsed = 0
            self._jerk, self._turning = ZERO, 0.0
            return None
        position, velocity, acceleration = guidance.motion
        yaw_rate = guidance.yaw_rate
        if self._elapsed:
            self._read(acceleration, yaw_rate)
        self._elapsed, self._acceleration, self._yaw_rate = step, acceleration, yaw_rate
        motion = origin.motion_to_site((position, velocity, acceleration, self._jerk))
        return Reference(
            motion[0],
            motion[1],
            motion[2],
            motion[3],
            yaw=guidance.yaw + origin.turn,
            yaw_rate=yaw_rate,
            yaw_acceleration=self._turning,
        )

    def _read(self, acceleration: Vector, yaw_rate: float) -> None:
        elapsed, share, turning_share = self._shares
        if elapsed != self._elapsed:
            elapsed, t = self._elapsed, self._elapsed * 1e-6
            share, turning_share = -math.expm1(-t / _JERK_TIME), -math.expm1(-t / _TURN_TIME)
            self._shares = elapsed, share, turning_share
        rate = 1e6 / elapsed
        (x, y, z), (u, v, w), (a, b, c) = self._jerk, acceleration, self._acceleration
        self._jerk = (
            x + share * (rate * (u - a) - x),
            y + share * (rate * (v - b) - y),
            z + share * (rate * (w - c) - z),
        )
        self._turning += turning_share * (rate * (yaw_rate - self._yaw_rate) - self._turning)


def believed(reference: Reference, off: Deviation) -> Reference:
    """Return the reference on the truth that equals ``reference`` on an estimate with the error ``off``."""
    return reference._replace(
        position=reference.position - off.position,
        velocity=reference.velocity - off.velocity,
        acceleration=reference.acceleration - _tilting(reference.acceleration.tolist(), off),
        yaw=reference.yaw - float(off.rotation[2]),
    )


class Level(NamedTuple):
    """Constants of vehicle and controller, over mass, for references without horizontal force."""

    mass: float  # kg
    drag: float  # 1/s, drag coefficient that the controller cancels
    k_x: float  # 1/s²
    k_v: float  # 1/s

    @classmethod
    def of(cls, vehicle: VehicleConfig) -> Self:
        """Return the constants of a vehicle."""
        numbers = airframe(vehicle)
        m = numbers.mass
        return cls(m, numbers.cancelled_drag / m, numbers.k_x / m, numbers.k_v / m)

    def unlocated(self, reference: Reference, off: Deviation, state: VehicleState) -> Reference:
        """Return a reference for an estimator without horizontal position and velocity.

        Height and heading are kept; otherwise the vehicle flies level in terms of its estimate, and so drifts
        with the air. Without an error to correct, the controller would cancel only drag and the force that it
        has estimated; the acceleration offsets both. The resulting motion of the vehicle must not turn the
        thrust: jerk and snap cancel the controller's response to an acceleration that was not requested.
        """
        shifted = believed(reference, off)
        position, velocity = shifted.position.copy(), shifted.velocity.copy()
        jerk, snap = shifted.jerk.copy(), shifted.snap.copy()
        position[:2], velocity[:2] = state.position[:2], state.velocity[:2]
        level = [0.0, 0.0, float(reference.acceleration[2])]
        acceleration = np.array(level) - _tilting(level, off)
        acceleration[:2] += state.learnt_force[:2] / self.mass - self.drag * velocity[:2]
        pushed = state.acceleration[:2] - acceleration[:2]
        jerk[:2] = self.k_v * pushed
        snap[:2] = self.k_x * pushed - self.k_v * jerk[:2]
        return shifted._replace(
            position=position, velocity=velocity, acceleration=acceleration, jerk=jerk, snap=snap
        )


def _tilting(acceleration: list[float], off: Deviation) -> FloatArray:
    """Return θ × (a − g), (3,) m/s²."""
    x, y, z = off.rotation.tolist()
    a, b, c = acceleration[0], acceleration[1], acceleration[2] - GRAVITY
    return np.array((y * c - z * b, z * a - x * c, x * b - y * a))
