"""Euler angles and quaternions (w, x, y, z; FRD body to NED), for messages."""

from __future__ import annotations

import math

from mavlink_bridge.messages import Vector

Quaternion = tuple[float, float, float, float]


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return (w, x, y, z) of yaw, then pitch, then roll (rad), FRD body to NED."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def euler(attitude: Quaternion) -> Vector:
    """Return roll, pitch and yaw (rad)."""
    w, x, y, z = attitude
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    return roll, pitch, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def of_thrust(force: Vector, yaw: float) -> Quaternion:
    """Return the attitude of a multirotor with heading ``yaw`` (rad) whose thrust makes ``force``.

    That is the specific force (m/s², NED), the acceleration without gravity; the body's z axis points against
    it.
    """
    north, east, down = force
    c, s = math.cos(yaw), math.sin(yaw)
    ahead, aside = c * north + s * east, c * east - s * north
    return quaternion(math.atan2(aside, math.hypot(ahead, down)), math.atan2(-ahead, -down), yaw)


def to_body(attitude: Quaternion, vector: Vector) -> Vector:
    """Rotate ``vector`` from NED to body axes (FRD)."""
    w, *axis = attitude
    x, y, z = axis
    a, b, c = vector
    # v − 2 w (q × v) + 2 q × (q × v)
    u, v, t = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a - 2.0 * w * u + 2.0 * (y * t - z * v),
        b - 2.0 * w * v + 2.0 * (z * u - x * t),
        c - 2.0 * w * t + 2.0 * (x * v - y * u),
    )
