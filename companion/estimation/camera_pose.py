"""Where the own camera looked, if it does not send CAMERA_FOV_STATUS (271).

By its gimbal's GIMBAL_DEVICE_ATTITUDE_STATUS (285), or by the ATTITUDE (30) of the vehicle that it is fixed
to, at the time of the image. Attitudes are quaternions from camera or body axes to NED.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from math import atan2, cos, radians, sin, sqrt

from pymavlink.dialects.v20 import all as mavlink

from companion.config.target_source import Optics
from mavlink_bridge.messages import Attitude, GimbalAttitude
from mavlink_bridge.pinhole import Quaternion, product

_KEPT = 512
"""Number of attitudes that are kept: ten seconds at 50 Hz."""
_NEAR_US = 200_000
"""An attitude holds for this time before and after it."""
_TO_NORTH = mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK | mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME
"""With one of these flags, and without ``…_YAW_IN_VEHICLE_FRAME``, a gimbal's yaw is relative to north."""


class CameraPose:
    """Attitudes of the vehicle and of its gimbal in the last seconds; times are the companion's, in µs."""

    def __init__(self, optics: Optics) -> None:
        self._mount = _about_y(-radians(optics.pitch_deg))
        self._body = _Turns()
        self._gimbal = _Turns()
        self._on_gimbal = False

    def receive_attitude(self, time: int, message: Attitude) -> None:
        """Receive the vehicle's attitude at ``time``."""
        self._body.add(time, _of_euler(message.roll, message.pitch, message.yaw))

    def receive_gimbal(self, time: int, message: GimbalAttitude) -> None:
        """Receive the gimbal's attitude at ``time``; without a known yaw it is not used."""
        self._on_gimbal = True
        attitude = message.attitude
        if not message.flags & _TO_NORTH or message.flags & mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME:
            # MAVLink truncates zeros at the end of a message: a difference of yaws that was not sent, and one
            # of exactly 0, look alike. Both count as unknown, as NaN does (None); then the vehicle's heading
            # counts, which is correct in both cases.
            heading = message.delta_yaw or self._heading(time)
            if heading is None:
                return
            attitude = product(_about_z(heading), attitude)
        self._gimbal.add(time, attitude)

    def at(self, time: int) -> Quaternion | None:
        """Return the camera's attitude at ``time``; None if none is known from about then.

        Since the first message of a gimbal, only the gimbal's attitude counts.
        """
        if self._on_gimbal:
            return self._gimbal.at(time)
        body = self._body.at(time)
        return None if body is None else product(body, self._mount)

    def _heading(self, time: int) -> float | None:
        """Return the vehicle's yaw (rad) at ``time``; None if none is known from about then."""
        body = self._body.at(time)
        if body is None:
            return None
        w, x, y, z = body
        return atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


class _Turns:
    """Attitudes in the order of their times."""

    def __init__(self) -> None:
        self._times: deque[int] = deque(maxlen=_KEPT)
        self._attitudes: deque[Quaternion] = deque(maxlen=_KEPT)

    def add(self, time: int, attitude: Quaternion) -> None:
        """Add an attitude at ``time``; one that is not later than the last one is ignored."""
        norm = sqrt(sum(part * part for part in attitude))
        if (self._times and time <= self._times[-1]) or not norm > 0.0:
            return
        w, x, y, z = attitude
        self._times.append(time)
        self._attitudes.append((w / norm, x / norm, y / norm, z / norm))

    def at(self, time: int) -> Quaternion | None:
        """Return the attitude at ``time``, between two that are near, or else the nearest one."""
        times, attitudes = self._times, self._attitudes
        after = bisect_left(times, time)
        near = [k for k in (after - 1, after) if 0 <= k < len(times) and abs(times[k] - time) <= _NEAR_US]
        if len(near) < 2:
            return attitudes[near[0]] if near else None
        share = (time - times[after - 1]) / (times[after] - times[after - 1])
        return _between(attitudes[after - 1], attitudes[after], share)


def _between(one: Quaternion, other: Quaternion, share: float) -> Quaternion:
    """Return the rotation at ``share`` of the way between two near ones (normalised linear interpolation)."""
    sign = 1.0 if sum(a * b for a, b in zip(one, other, strict=True)) >= 0.0 else -1.0
    mixed = [(1.0 - share) * a + sign * share * b for a, b in zip(one, other, strict=True)]
    norm = sqrt(sum(part * part for part in mixed))
    w, x, y, z = (part / norm for part in mixed)
    return w, x, y, z


def _of_euler(roll: float, pitch: float, yaw: float) -> Quaternion:
    about_x = (cos(0.5 * roll), sin(0.5 * roll), 0.0, 0.0)
    return product(_about_z(yaw), product(_about_y(pitch), about_x))


def _about_y(angle: float) -> Quaternion:
    return cos(0.5 * angle), 0.0, sin(0.5 * angle), 0.0


def _about_z(angle: float) -> Quaternion:
    return cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle)
