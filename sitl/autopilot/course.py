"""References of the controller: the guidance's motion with its jerk, in terms of the estimate.

A real autopilot closes its position loop on its estimate. The simulated controller receives the true state,
so the estimate's error is subtracted from the reference instead: for an estimate x̂ = x + e, the control error
x̂ − x_d equals x − (x_d − e). With position, velocity and yaw so shifted the vehicle flies exactly as if the
controller had received the estimate. An attitude error tilts the thrust, which adds the acceleration
−θ × (a − g) to first order, with the attitude error θ as a rotation vector and the requested specific force
a − g. Body rates are not shifted: the noise of the rate loop's gyros lies far above the motors' bandwidth,
and their bias is part of the yaw error.
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

_JERK_TIME_CONSTANT: Final = 0.1
"""Time constant of the jerk that is derived from a stream of accelerations (s)."""
_STEP: Final = 5.0
"""Change of the acceleration between two references (m/s²) from which on none of it counts as jerk."""
_YAW_ACCELERATION_TIME_CONSTANT: Final = 0.03
"""Time constant of the yaw acceleration that is derived from a stream of yaw rates (s)."""


class Course:
    """Generator of references (site NED) from the guidance (local NED).

    Set-points carry neither jerk nor yaw acceleration. Without jerk the controller does not anticipate
    rotation of the thrust axis and lags in curves; without yaw acceleration a weak yaw control lags in every
    turn. Both are derived from the motion, low-pass filtered so that a step does not cause a jolt. The share
    of a step of the acceleration that counts as jerk falls with its square, to none at 5 m/s²: the step
    itself changes the requested thrust. For a small step the jerk compensates the lag of the attitude; a
    large one counted in full drives the rotors to their limits and tilts the vehicle too far.
    """

    def __init__(self, guidance: Guidance, origin: Origin) -> None:
        self._guidance = guidance
        self._origin = origin
        self._elapsed = 0
        self._filter_gains = (0, 0.0, 0.0)
        self._acceleration = self._jerk = ZERO
        self._yaw_rate = self._yaw_acceleration = 0.0

    @property
    def reference(self) -> Reference | None:
        """Requested motion without jerk and yaw acceleration; None if the guidance is idle.

        With a model of a firmware's response, this is the motion that position set-points request, and the
        motion of ``next`` lags behind it.
        """
        guidance = self._guidance
        if guidance.activity is Activity.IDLE:
            return None
        motion = self._origin.motion_to_site(guidance.commanded)
        yaw = guidance.yaw + self._origin.turn
        return Reference(motion[0], motion[1], motion[2], yaw=yaw, yaw_rate=guidance.yaw_rate)

    def next(self, step: int) -> Reference | None:
        """Return the reference of the next ``step`` µs; call this once per step, in their order."""
        guidance, origin = self._guidance, self._origin
        if guidance.activity is Activity.IDLE:
            self._elapsed = 0
            self._jerk, self._yaw_acceleration = ZERO, 0.0
            return None
        position, velocity, acceleration = guidance.motion
        yaw_rate = guidance.yaw_rate
        if self._elapsed:
            self._differentiate(acceleration, yaw_rate)
        self._elapsed, self._acceleration, self._yaw_rate = step, acceleration, yaw_rate
        motion = origin.motion_to_site((position, velocity, acceleration, self._jerk))
        return Reference(
            motion[0],
            motion[1],
            motion[2],
            motion[3],
            yaw=guidance.yaw + origin.turn,
            yaw_rate=yaw_rate,
            yaw_acceleration=self._yaw_acceleration,
        )

    def _differentiate(self, acceleration: Vector, yaw_rate: float) -> None:
        elapsed, gain, yaw_gain = self._filter_gains
        if elapsed != self._elapsed:
            elapsed, t = self._elapsed, self._elapsed * 1e-6
            gain, yaw_gain = (
                -math.expm1(-t / _JERK_TIME_CONSTANT),
                -math.expm1(-t / _YAW_ACCELERATION_TIME_CONSTANT),
            )
            self._filter_gains = elapsed, gain, yaw_gain
        rate = 1e6 / elapsed
        (x, y, z), (u, v, w), (a, b, c) = self._jerk, acceleration, self._acceleration
        step = math.dist(acceleration, self._acceleration) / _STEP
        rising = rate * max(0.0, 1.0 - step * step)
        self._jerk = (
            x + gain * (rising * (u - a) - x),
            y + gain * (rising * (v - b) - y),
            z + gain * (rising * (w - c) - z),
        )
        self._yaw_acceleration += yaw_gain * (rate * (yaw_rate - self._yaw_rate) - self._yaw_acceleration)


def believed(reference: Reference, off: Deviation) -> Reference:
    """Return ``reference`` shifted so that control on the truth acts as on an estimate with error ``off``."""
    return reference._replace(
        position=reference.position - off.position,
        velocity=reference.velocity - off.velocity,
        acceleration=reference.acceleration - _tilt_acceleration(reference.acceleration.tolist(), off),
        yaw=reference.yaw - float(off.rotation[2]),
    )


class Level(NamedTuple):
    """Mass, and constants of the controller divided by mass, for references without horizontal force."""

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

        Height and heading are tracked; horizontally the vehicle flies level in terms of its estimate, and so
        drifts with the air. The horizontal errors of position and velocity are set to zero; the acceleration
        offsets the controller's compensation of drag and of the estimated disturbance force. Jerk and snap
        offset the controller's response to acceleration that was not requested, so that this response does
        not turn the thrust.
        """
        shifted = believed(reference, off)
        position, velocity = shifted.position.copy(), shifted.velocity.copy()
        jerk, snap = shifted.jerk.copy(), shifted.snap.copy()
        position[:2], velocity[:2] = state.position[:2], state.velocity[:2]
        level = [0.0, 0.0, float(reference.acceleration[2])]
        acceleration = np.array(level) - _tilt_acceleration(level, off)
        acceleration[:2] += state.learnt_force[:2] / self.mass - self.drag * velocity[:2]
        unrequested = state.acceleration[:2] - acceleration[:2]
        jerk[:2] = self.k_v * unrequested
        snap[:2] = self.k_x * unrequested - self.k_v * jerk[:2]
        return shifted._replace(
            position=position, velocity=velocity, acceleration=acceleration, jerk=jerk, snap=snap
        )


def _tilt_acceleration(acceleration: list[float], off: Deviation) -> FloatArray:
    """Return θ × (a − g), (3,) m/s², from a (m/s², NED) and the attitude error θ in ``off``."""
    x, y, z = off.rotation.tolist()
    a, b, c = acceleration[0], acceleration[1], acceleration[2] - GRAVITY
    return np.array((y * c - z * b, z * a - x * c, x * b - y * a))
