"""Set-points as interpreted by an autopilot, and the constants shared by both dialects.

ArduPilot and PX4 interpret a SET_POSITION_TARGET_LOCAL_NED (84) differently: ``sitl.autopilot.firmware``
holds the two interpretations. Each turns the message into one ``Reading``: a ``Setpoint`` to fly, a ``Stop``
(understood as "brake and hold") or a ``Refusal`` (nothing changes). A stop or a refusal carries the reason
that is sent back as STATUSTEXT.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import SetpointLocal, Vector

IGNORE_POSITION: Final[int] = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
IGNORE_VELOCITY: Final[int] = (
    mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE
)
IGNORE_ACCELERATION: Final[int] = (
    mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
)

# Level of an axis: the lowest derivative that a set-point gives for it, which is the quantity controlled.
POSITION: Final = 0
VELOCITY: Final = 1
ACCELERATION: Final = 2

ZERO: Final[Vector] = (0.0, 0.0, 0.0)

# The conversion to float32 may raise a number at a limit slightly above it.
_ROUNDING: Final = 1.0 + 1e-6
# Bounds (SI, rad) that no flight exceeds. Larger numbers are corrupt, and could overflow the float32 fields
# of POSITION_TARGET_LOCAL_NED (85), which repeats the set-point.
_MAX_POSITION, _MAX_VALUE, _MAX_YAW_RATE = 1e5, 1e3, 1e2
_RANGES: Final = (
    ("position", _MAX_POSITION),
    ("velocity", _MAX_VALUE),
    ("acceleration", _MAX_VALUE),
    ("yaw", _MAX_VALUE),
    ("yaw rate", _MAX_YAW_RATE),
)


class Pose(NamedTuple):
    """Estimated pose: position (m, own local NED) and yaw (rad, clockwise from north)."""

    position: Vector
    yaw: float


class Setpoint(NamedTuple):
    """Motion to follow, in the vehicle's own local NED, valid at the time it was received.

    ``levels`` gives the controlled quantity per axis (POSITION, VELOCITY or ACCELERATION); the derivatives of
    that quantity are feed-forward, zero where they were not given. ``complete`` if all axes have position
    *and* velocity, so that the stream is a trajectory and not a destination. ``yaw`` and ``yaw_rate`` (rad,
    rad/s) are None if ignored.
    """

    levels: tuple[int, int, int]
    position: Vector = ZERO
    velocity: Vector = ZERO
    acceleration: Vector = ZERO
    yaw: float | None = None
    yaw_rate: float | None = None
    complete: bool = False

    @property
    def moves(self) -> bool:
        """Whether it requests motion that must end if no further set-point arrives."""
        return (
            self.levels != (POSITION, POSITION, POSITION)
            or self.velocity != ZERO
            or self.acceleration != ZERO
        )

    def limited(self, speed: float, acceleration: float) -> Setpoint:
        """Return it with the norms of velocity and acceleration limited (m/s, m/s²).

        A changed set-point is not ``complete``.
        """
        fast = math.hypot(*self.velocity)
        strong = math.hypot(*self.acceleration)
        if fast <= speed * _ROUNDING and strong <= acceleration * _ROUNDING:
            return self
        return self._replace(
            velocity=scaled(self.velocity, min(1.0, speed / fast) if fast else 1.0),
            acceleration=scaled(self.acceleration, min(1.0, acceleration / strong) if strong else 1.0),
            complete=False,
        )

    def after(self, age: float, thrusting: float) -> Setpoint:
        """Return it extrapolated by ``age`` seconds.

        The acceleration acts for the first ``thrusting`` seconds; then the velocity is constant
        (constant-acceleration kinematics, per axis).
        """
        burn = age if age < thrusting else thrusting
        coast = age - burn
        (x, y, z), (vx, vy, vz), (ax, ay, az) = self.position, self.velocity, self.acceleration
        ux, uy, uz = vx + ax * burn, vy + ay * burn, vz + az * burn
        half = 0.5 * burn
        return Setpoint(
            self.levels,
            (
                x + (vx + ux) * half + ux * coast,
                y + (vy + uy) * half + uy * coast,
                z + (vz + uz) * half + uz * coast,
            ),
            (ux, uy, uz),
            self.acceleration if coast == 0.0 else ZERO,
            None if self.yaw is None else self.yaw + (self.yaw_rate or 0.0) * age,
            self.yaw_rate,
            self.complete,
        )


class Stop(NamedTuple):
    """Interpretation as "brake and hold"."""

    reason: str


class Refusal(NamedTuple):
    """Interpretation as not understood or not acceptable: nothing changes."""

    reason: str


Reading = Setpoint | Stop | Refusal


def scaled(vector: Vector, factor: float) -> Vector:
    """Return ``factor`` times ``vector``."""
    return vector[0] * factor, vector[1] * factor, vector[2] * factor


def rotated(vector: Vector, yaw: float) -> Vector:
    """Return a vector in NED, given forward-right-down of a level vehicle of heading ``yaw`` (rad)."""
    c, s = math.cos(yaw), math.sin(yaw)
    return c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]


def unusable(message: SetpointLocal, mask: int) -> str | None:
    """Return the reason why a field that ``mask`` uses is unusable (NaN, infinite, out of range), or None."""
    if _usable(message):
        return None
    fields = (message.position, message.velocity, message.acceleration, (message.yaw,), (message.yaw_rate,))
    bits = (
        mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE,
        mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE,
        mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE,
        mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE,
        mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE,
    )
    for values, bit, (name, bound) in zip(fields, bits, _RANGES, strict=True):
        for axis, value in enumerate(values):
            if not mask & bit << axis and not abs(value) <= bound:
                fault = "out of range" if math.isfinite(value) else "not a number"
                return f"Set-point refused: {name} {fault}"
    return None


def _usable(message: SetpointLocal) -> bool:
    """Return whether all fields, used or not, are valid: the usual case, checked quickly."""
    (x, y, z), (u, v, w), (a, b, c) = message.position, message.velocity, message.acceleration
    return (
        -_MAX_POSITION <= x <= _MAX_POSITION
        and -_MAX_POSITION <= y <= _MAX_POSITION
        and -_MAX_POSITION <= z <= _MAX_POSITION
        and -_MAX_VALUE <= u <= _MAX_VALUE
        and -_MAX_VALUE <= v <= _MAX_VALUE
        and -_MAX_VALUE <= w <= _MAX_VALUE
        and -_MAX_VALUE <= a <= _MAX_VALUE
        and -_MAX_VALUE <= b <= _MAX_VALUE
        and -_MAX_VALUE <= c <= _MAX_VALUE
        and -_MAX_VALUE <= message.yaw <= _MAX_VALUE
        and -_MAX_YAW_RATE <= message.yaw_rate <= _MAX_YAW_RATE
    )


def mask_of(setpoint: Setpoint) -> int:
    """Return the type mask of the followed set-point, for POSITION_TARGET_LOCAL_NED (85)."""
    mask = 0
    for axis, level in enumerate(setpoint.levels):
        if level > POSITION:
            mask |= mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE << axis
        if level > VELOCITY:
            mask |= mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE << axis
    if not setpoint.complete and POSITION in setpoint.levels and setpoint.velocity == ZERO:
        mask |= IGNORE_VELOCITY
    if setpoint.acceleration == ZERO and ACCELERATION not in setpoint.levels:
        mask |= IGNORE_ACCELERATION
    if setpoint.yaw is None:
        mask |= mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    if setpoint.yaw_rate is None:
        mask |= mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
    return mask
