"""Shaping of references: acceleration and jerk of the approach are bounded, and its speed is controlled.

The geometric controller must never receive a step. ``Shaper`` is a point mass that approaches the set-point:
far away it keeps to a speed limit, closer it brakes at a constant deceleration, and at the end it converges
exponentially. It serves destinations, velocities, accelerations and moving set-points alike. A set-point that
is a trajectory (position and velocity on all axes, within limits) is passed through unchanged once the point
mass has converged to it, until it jumps by more than the release distance or speed: then the point mass
approaches it again from its present motion.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from mavlink_bridge.messages import Vector
from sitl.values.setpoints import ACCELERATION, POSITION, ZERO, Setpoint

_POSITION_RATE: Final = 2.0  # 1/s, of the final convergence
_VELOCITY_RATE: Final = 4.0  # 1/s
# Share of the acceleration limit with which braking is planned; the rest is for corrections.
_BRAKING: Final = 0.6
_CAPTURE: Final = (0.05, 0.2)  # m, m/s
_RELEASE: Final = (0.5, 1.0)  # m, m/s
_AT_REST: Final = (1e-5, 1e-4)  # m/s, m/s²

_YAW_RATES: Final = (6.0, 12.0)  # 1/s, final convergence of the yaw and of the yaw rate
_MIN_YAW_RATE: Final = 1e-6  # rad/s
_FULL_TURN: Final = 2.0 * math.pi


class Limits(NamedTuple):
    """Limits of the norms of speed (m/s), acceleration (m/s²) and jerk (m/s³)."""

    speed: float
    acceleration: float
    jerk: float


class Shaper:
    """Point mass that approaches a set-point.

    ``position``, ``velocity`` and ``acceleration`` (SI) are in one inertial frame.
    """

    def __init__(self, position: Vector = ZERO) -> None:
        self.restart(position)

    def restart(self, position: Vector) -> None:
        """Rest at ``position``."""
        self.position = position
        self.velocity = ZERO
        self.acceleration = ZERO
        self.captured = False

    @property
    def at_rest(self) -> bool:
        """Whether speed and acceleration are below ``_AT_REST``, which no controller can detect."""
        return math.hypot(*self.velocity) < _AT_REST[0] and math.hypot(*self.acceleration) < _AT_REST[1]

    def advance(self, wanted: Setpoint, limits: Limits, dt: float) -> None:
        """Advance by ``dt`` seconds; ``wanted`` is valid at the end of the step."""
        if wanted.complete and self._follows(wanted, dt):
            self.position, self.velocity, self.acceleration = (
                wanted.position,
                wanted.velocity,
                wanted.acceleration,
            )
            return
        self._integrate(self._demand(wanted, limits, dt), limits.jerk * dt, dt)

    def _follows(self, wanted: Setpoint, dt: float) -> bool:
        """Return whether the set-point may be passed through, with hysteresis between capture and release."""
        distance, speed = _RELEASE if self.captured else _CAPTURE
        half = 0.5 * dt * dt
        (x, y, z), (vx, vy, vz), (ax, ay, az) = self.position, self.velocity, self.acceleration
        (gx, gy, gz), (ux, uy, uz) = wanted.position, wanted.velocity
        gap = math.hypot(
            gx - x - vx * dt - ax * half, gy - y - vy * dt - ay * half, gz - z - vz * dt - az * half
        )
        speed_error = math.hypot(ux - vx - ax * dt, uy - vy - ay * dt, uz - vz - az * dt)
        self.captured = gap <= distance and speed_error <= speed
        return self.captured

    def _demand(self, wanted: Setpoint, limits: Limits, dt: float) -> Vector:
        """Return the acceleration that brings the point mass onto the set-point, limited in norm."""
        lx, ly, lz = wanted.levels
        x, y, z = self.position
        vx, vy, vz = self.velocity
        gx, gy, gz = wanted.position
        # An axis controlled by acceleration alone keeps its velocity: no feedback but the speed limit.
        ux, uy, uz = wanted.velocity
        ux = vx if lx == ACCELERATION else ux
        uy = vy if ly == ACCELERATION else uy
        uz = vz if lz == ACCELERATION else uz
        # The gap at the beginning of the step, the time of the point mass's state.
        ex = gx - ux * dt - x if lx == POSITION else 0.0
        ey = gy - uy * dt - y if ly == POSITION else 0.0
        ez = gz - uz * dt - z if lz == POSITION else 0.0
        # Relative velocity of the axes that close on a position: the rate of change of e.
        rx = ux - vx if lx == POSITION else 0.0
        ry = uy - vy if ly == POSITION else 0.0
        rz = uz - vz if lz == POSITION else 0.0

        distance = math.sqrt(ex * ex + ey * ey + ez * ez)
        scale, slope = _approach(distance, _POSITION_RATE, _BRAKING * limits.acceleration, limits.speed)
        # d/dt (e s(d)/d) = ė s/d + e (s' − s/d) ḋ/d: the acceleration that the closing speed itself implies.
        closing = (ex * rx + ey * ry + ez * rz) / (distance * distance) if distance > 1e-9 else 0.0
        bend = (slope - scale) * closing

        wx, wy, wz = ux + ex * scale, uy + ey * scale, uz + ez * scale
        speed = math.sqrt(wx * wx + wy * wy + wz * wz)
        if speed > limits.speed:
            clip = limits.speed / speed
            wx, wy, wz = wx * clip, wy * clip, wz * clip
        fx, fy, fz = wanted.acceleration
        return _clipped(
            (
                fx + rx * scale + ex * bend + _VELOCITY_RATE * (wx - vx),
                fy + ry * scale + ey * bend + _VELOCITY_RATE * (wy - vy),
                fz + rz * scale + ez * bend + _VELOCITY_RATE * (wz - vz),
            ),
            limits.acceleration,
        )

    def _integrate(self, demand: Vector, limit: float, dt: float) -> None:
        """Change the acceleration towards ``demand`` by at most ``limit``, then integrate over the step."""
        ax, ay, az = self.acceleration
        dx, dy, dz = _clipped((demand[0] - ax, demand[1] - ay, demand[2] - az), limit)
        ax, ay, az = ax + dx, ay + dy, az + dz
        half = 0.5 * dt * dt
        x, y, z = self.position
        vx, vy, vz = self.velocity
        self.acceleration = (ax, ay, az)
        self.position = (x + vx * dt + ax * half, y + vy * dt + ay * half, z + vz * dt + az * half)
        self.velocity = (vx + ax * dt, vy + ay * dt, vz + az * dt)


class Heading:
    """Yaw (rad, clockwise from north) with bounded rate (rad/s) and angular acceleration (rad/s²)."""

    def __init__(self, rate: float, acceleration: float) -> None:
        self._rate, self._acceleration = rate, acceleration
        self.restart(0.0)

    def restart(self, yaw: float) -> None:
        """Rest at ``yaw``."""
        self.yaw = yaw
        self.yaw_rate = 0.0

    def advance(self, yaw: float | None, yaw_rate: float | None, dt: float) -> None:
        """Turn the short way to ``yaw`` (rad), which itself turns at ``yaw_rate`` (rad/s), in ``dt`` seconds.

        ``yaw`` is valid at the end of the step. Without it only the rate is tracked; None for both stops the
        turn.
        """
        wanted = yaw_rate or 0.0
        error = 0.0 if yaw is None else math.remainder(yaw - wanted * dt - self.yaw, _FULL_TURN)
        if error == 0.0 and wanted == 0.0 and self.yaw_rate == 0.0:
            return
        near, quick = _YAW_RATES
        scale, slope = _approach(abs(error), near, _BRAKING * self._acceleration, self._rate)
        push = slope * (wanted - self.yaw_rate) if yaw is not None else 0.0
        aim = max(-self._rate, min(self._rate, wanted + error * scale))
        change = push + quick * (aim - self.yaw_rate)
        change = max(-self._acceleration, min(self._acceleration, change))
        self.yaw_rate += change * dt
        if wanted == 0.0 and error == 0.0 and abs(self.yaw_rate) < _MIN_YAW_RATE:
            self.yaw_rate = 0.0
        self.yaw = math.remainder(self.yaw + self.yaw_rate * dt, _FULL_TURN)


def _approach(distance: float, rate: float, braking: float, speed: float) -> tuple[float, float]:
    """Return s/d and s'(d) (1/s) of the approach law s(d), the closing speed at the distance d.

    The law is ``rate`` · d near zero, √(2 a (d − d₀)) further out with a = ``braking`` and d₀ = a/(2 rate²),
    then the limit ``speed``. The speed may also be a yaw rate, and the distance an angle.
    """
    near = braking / (rate * rate)
    if distance <= near:
        return (rate, rate) if rate * distance <= speed else (speed / distance, 0.0)
    wanted = math.sqrt(2.0 * braking * (distance - 0.5 * near))
    return (wanted / distance, braking / wanted) if wanted < speed else (speed / distance, 0.0)


def _clipped(vector: Vector, limit: float) -> Vector:
    x, y, z = vector
    norm = math.sqrt(x * x + y * y + z * z)
    if norm <= limit:
        return vector
    factor = limit / norm
    return x * factor, y * factor, z * factor
