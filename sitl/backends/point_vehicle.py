"""Vehicle without physics: a point that is where its reference says, to compare with planners that assume so.

With ``point_window_us`` = 0 it is a double integrator: position, velocity and acceleration are those of the
reference. With a window W it is a triple integrator: its motion is the mean of the reference's over the last
W. The mean of a motion whose acceleration is constant between knots W apart has a jerk of (a_k − a_{k−1})/W:
a bound on the change of acceleration from knot to knot becomes a bound on jerk that holds at all times. The
mean is ½ W late, and differs from the reference of that time by at most ‖a‖ W²/24.

There is no wind, no motor and no tube. Attitude and rotor speeds are those of a multirotor that would fly so;
only telemetry and the battery read them. Without a reference the point falls, and stays on the ground.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from mavlink_bridge.messages import Vector
from sitl.values.attitudes import of_thrust
from sitl.vehicle.airframe import FloatArray, hover_speeds
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.ground import GRAVITY
from sitl.vehicle.multirotor import NotFiniteError, Reference, VehicleState, checked_rotor

_ON_GROUND_M = 1e-6
"""Height (m) above its rest height below which a point without a reference stands."""


class PointVehicle:
    """One point over flat ground, as a ``Physics``."""

    def __init__(
        self, config: VehicleConfig, position: ArrayLike, yaw: float, ground: float, *, hovering: bool
    ) -> None:
        """Start at rest at ``position`` (3,), m, NED, with heading ``yaw`` (rad); ``ground`` is a z (m, NED).

        Raises ValueError for a hover position that is not above the ground.
        """
        self.config = config
        self._period = config.physics_period * 1e-6
        self._window = round(config.point_window_us / config.physics_period)
        self._floor = ground - config.rest_height
        place = np.array(position, dtype=np.float64).reshape(3)
        if hovering and place[2] >= self._floor:
            raise ValueError(
                f"a point cannot hover at z = {place[2]:g} m: it must be less than {self._floor:g} m"
            )
        place[2] = min(place[2], self._floor)
        self._motion = np.zeros((3, 3))
        self._motion[0] = place
        self._yaw, self._yaw_rate = yaw, 0.0
        self._turns = np.array(hover_speeds(config)) if hovering else np.zeros(len(config.rotors))
        # Reference motions (position, velocity, acceleration) at the last steps, as many as the window has.
        self._past = self._resting()
        self._stands = not hovering and place[2] >= self._floor

    def _resting(self) -> FloatArray:
        still = np.zeros((3, 3))
        still[0] = self._motion[0]
        return np.repeat(still[None], self._window + 1, axis=0)

    def advance(
        self,
        steps: int,
        reference: Reference | None,
        wind: ArrayLike = (0.0, 0.0, 0.0),
        *,
        idle: bool = False,
    ) -> FloatArray:
        """Advance as defined by ``Physics``; ``wind`` has no effect."""
        if reference is None:
            return self._fall(steps)
        x, v, a = reference.position, reference.velocity, reference.acceleration
        if not all(np.isfinite(part).all() for part in (x, v, a)) or not math.isfinite(reference.yaw):
            raise NotFiniteError(f"the reference of {self.config.name} is not finite: {reference}")
        t = self._period * np.arange(1, steps + 1)[:, None]
        wanted = np.empty((steps, 3, 3))
        wanted[:, 0], wanted[:, 1], wanted[:, 2] = x + t * (v + 0.5 * t * a), v + t * a, a
        motions = self._averaged(wanted)
        below = motions[:, 0, 2] > self._floor
        motions[below, 0, 2] = self._floor
        motions[below, 1:, 2] = np.minimum(motions[below, 1:, 2], 0.0)
        self._motion = motions[-1].copy()
        self._stands = bool(below[-1]) or self._motion[0, 2] >= self._floor
        seconds = steps * self._period
        self._yaw = reference.yaw + seconds * reference.yaw_rate
        self._yaw_rate = reference.yaw_rate
        self._turns = np.array(hover_speeds(self.config))
        return motions[:, 0].copy()

    def _averaged(self, wanted: FloatArray) -> FloatArray:
        """Return the means (n, 3, 3) of the motions ``wanted`` (n, 3, 3) over the window, by trapezoids."""
        width = self._window
        if width == 0:
            return wanted
        everything = np.concatenate([self._past, wanted])
        self._past = everything[len(wanted) :]
        sums = np.zeros_like(everything)
        np.cumsum(0.5 * (everything[1:] + everything[:-1]), axis=0, out=sums[1:])
        means: FloatArray = (sums[width + 1 :] - sums[1:-width]) / width
        return means

    def _fall(self, steps: int) -> FloatArray:
        """Fall freely to the ground, and stay there."""
        track = np.empty((steps, 3))
        position, velocity, acceleration = self._motion
        acceleration[:] = 0.0
        for i in range(steps):
            if position[2] >= self._floor - _ON_GROUND_M:
                position[2], velocity[:] = self._floor, 0.0
            else:
                velocity[2] += GRAVITY * self._period
                position += self._period * velocity
                position[2] = min(position[2], self._floor)
            track[i] = position
        self._stands = bool(position[2] >= self._floor)
        self._yaw_rate = 0.0
        self._turns = np.zeros(len(self.config.rotors))
        self._past = self._resting()
        return track

    def fail_rotor(self, index: int, left: float) -> None:
        """Raise ValueError: a point has no rotors that could fail; IndexError as defined by ``Physics``."""
        checked_rotor(self.config, index, left)
        raise ValueError(f"rotor {index} of {self.config.name}: a point has no rotors")

    @property
    def state(self) -> VehicleState:
        """True state after the last step."""
        position, velocity, acceleration = self._motion.copy()
        rates = np.array((0.0, 0.0, self._yaw_rate))
        north, east, down = acceleration.tolist()
        attitude = np.array(of_thrust((north, east, down - GRAVITY), self._yaw))
        return VehicleState(position, velocity, attitude, rates, self._turns.copy(), acceleration)

    @property
    def on_ground(self) -> bool:
        """Whether the point stands on the ground after the last step."""
        return self._stands

    @property
    def air(self) -> Vector:
        """Still air: wind has no effect."""
        return 0.0, 0.0, 0.0
