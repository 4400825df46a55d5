"""Airframe of a firmware's simulator as a point mass, with lag of tilt and thrust, and drag.

Both firmwares tilt for a wanted acceleration as in hover, by atan(a/g), and keep the vertical part of the
thrust at the throttle's. So the horizontal acceleration, less drag, is the vertical part of the thrust times
tan(tilt): less than wanted while the vehicle accelerates downwards, and more while it does upwards. Full
thrust limits the whole: a tilted vehicle has full thrust · cos(tilt) upwards at most. The attitude loop is
modelled as a second-order lag on each tilt angle; yaw has no effect on a point mass.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from mavlink_bridge.messages import Vector
from sitl.values.setpoints import ZERO

GRAVITY: Final = 9.80665

HOVER_THROTTLE: Final = 0.364
"""Throttle at which the 3 kg quadrotor of ArduPilot's SITL hovers, as its logs tell (CTUN.ThO).

It is of this frame only: another vehicle's full thrust, and its gain from throttle to acceleration, differ.
"""

Motion = tuple[Vector, Vector, Vector]
"""Position (m), velocity (m/s), acceleration (m/s²), in one inertial frame, z down."""


class Airframe(NamedTuple):
    """Constants of an airframe.

    ``angle_rate`` 1/s: requested tilt rate per angle of error; ``angle_acceleration`` rad/s²: limit of the
    change of that rate; ``angle_lag`` s: first-order lag from the requested angle to the tilt; ``thrust_lag``
    s: lag of vertical thrust. ``drag`` 1/s and ``square_drag`` 1/m: deceleration per speed, and per square of
    speed, relative to the air. ``vertical_drag``: whether drag also acts vertically. ``full_thrust`` m/s²:
    acceleration by all of the thrust.
    """

    angle_rate: float
    angle_acceleration: float
    angle_lag: float
    thrust_lag: float
    drag: float
    square_drag: float
    vertical_drag: bool
    full_thrust: float


ARDUPILOT: Final = Airframe(
    # ATC_INPUT_TC 0.15 s and ATC_ACCEL_R_MAX 1100 °/s²; the lag represents the attitude and rate loops.
    angle_rate=1.0 / 0.15,
    angle_acceleration=math.radians(1100.0),
    angle_lag=0.04,
    # The throttle's filter of 2 Hz.
    thrust_lag=0.08,
    # The 3 kg quadrotor of ArduPilot's SITL: momentum drag of four rotors at hover thrust, 0.74 N per m/s,
    # and 0.10 N per (m/s)².
    drag=0.246,
    square_drag=0.0336,
    vertical_drag=False,
    # AP_Motors makes the thrust proportional to the throttle.
    full_thrust=GRAVITY / HOVER_THROTTLE,
)
PX4: Final = Airframe(
    # MC_ROLL_P; the rate loop is much faster than the angle loop.
    angle_rate=6.5,
    angle_acceleration=40.0,
    angle_lag=0.05,
    thrust_lag=0.06,
    # SIH_KDV 1 N per m/s on SIH_MASS 1 kg.
    drag=1.0,
    square_drag=0.0,
    vertical_drag=True,
    # Four rotors with SIH_T_MAX 5 N.
    full_thrust=20.0,
)


class PointMass:
    """Point mass that is controlled by acceleration: ``position``, ``velocity``, ``acceleration``; z down."""

    def __init__(self, airframe: Airframe) -> None:
        self._airframe = airframe
        self.restart(ZERO)

    def restart(self, position: Vector) -> None:
        """Rest at ``position``, level."""
        self.position: Vector = position
        self.velocity: Vector = ZERO
        self.acceleration: Vector = ZERO
        self._requested_tilt = [0.0, 0.0]
        self._rate = [0.0, 0.0]
        self._tilt = [0.0, 0.0]
        self._vertical_acceleration = 0.0

    @property
    def highest(self) -> float:
        """Acceleration (m/s², down; negative is upwards) that full thrust gives at the present tilt."""
        level = math.hypot(*map(math.tan, self._tilt))
        return GRAVITY - self._airframe.full_thrust / math.hypot(1.0, level)

    def advance(self, wanted: Vector, wind: Vector, dt: float, drift: Vector = (0.0, 0.0, 0.0)) -> None:
        """Advance by ``dt`` seconds towards the acceleration ``wanted`` (m/s², without drag).

        ``wind`` (m/s) is the velocity of the air. The position is the estimated one, which moves by ``drift``
        (m/s) more than the velocity indicates.
        """
        frame = self._airframe
        gain = -math.expm1(-dt / frame.angle_lag)
        max_change = frame.angle_acceleration * dt
        for axis in (0, 1):
            error = math.atan(wanted[axis] / GRAVITY) - self._requested_tilt[axis]
            change = error * frame.angle_rate - self._rate[axis]
            self._rate[axis] += max(-max_change, min(max_change, change))
            self._requested_tilt[axis] += self._rate[axis] * dt
            self._tilt[axis] += gain * (self._requested_tilt[axis] - self._tilt[axis])
        self._vertical_acceleration += -math.expm1(-dt / frame.thrust_lag) * (
            wanted[2] - self._vertical_acceleration
        )
        north, east, down = (v - w for v, w in zip(self.velocity, wind, strict=True))
        drag, square = frame.drag, frame.square_drag
        vertical = max(self._vertical_acceleration, self.highest)
        # Rotors do not push downwards.
        lift = max(GRAVITY - vertical, 0.0)
        self._integrate(
            (
                lift * math.tan(self._tilt[0]) - (drag + square * abs(north)) * north,
                lift * math.tan(self._tilt[1]) - (drag + square * abs(east)) * east,
                vertical - (drag * down if frame.vertical_drag else 0.0),
            ),
            dt,
        )
        x, y, z = self.position
        self.position = (x + drift[0] * dt, y + drift[1] * dt, z + drift[2] * dt)

    def _integrate(self, acceleration: Vector, dt: float) -> None:
        half = 0.5 * dt * dt
        (x, y, z), (u, v, w), (a, b, c) = self.position, self.velocity, acceleration
        self.position = (x + u * dt + a * half, y + v * dt + b * half, z + w * dt + c * half)
        self.velocity = (u + a * dt, v + b * dt, w + c * dt)
        self.acceleration = acceleration
