"""Builders of further telemetry for ground stations: GPS, battery, home, mission, version, estimator."""

from __future__ import annotations

import math
from typing import Final

from mavlink_bridge.messages import (
    Altitude,
    AttitudeQuaternion,
    BatteryStatus,
    EstimatorStatus,
    GpsRaw,
    Message,
    SystemTime,
    VfrHud,
)
from sitl.telemetry.reports import Snapshot, estimator_flags
from sitl.values.attitudes import quaternion

SYSTEM_TIME: Final = 2
GPS_RAW: Final = 24
ATTITUDE_QUATERNION: Final = 31
MISSION_CURRENT: Final = 42
VFR_HUD: Final = 74
ALTITUDE: Final = 141
BATTERY_STATUS: Final = 147
AUTOPILOT_VERSION: Final = 148
FENCE_STATUS: Final = 162
ESTIMATOR_STATUS: Final = 230
HOME: Final = 242

# GPS_FIX_TYPE: none, 2D and 3D
_NO_FIX, _FIX_2D, _FIX_3D = 1, 2, 3
_SATELLITES: Final = 12
# MAV_BATTERY_TYPE lithium polymer, MAV_BATTERY_FUNCTION_ALL; MAV_BATTERY_CHARGE_STATE ok, low, critical
_LIPO, _ALL, _OK, _LOW, _CRITICAL = 1, 1, 1, 2, 3
_LOW_AT, _CRITICAL_AT = 0.15, 0.07
# Limit of the speed field of GPS_RAW_INT (m/s).
_FASTEST: Final = 655.0
_NAN: Final = math.nan


def system_time(s: Snapshot) -> Message:
    """Return SYSTEM_TIME (2)."""
    return SystemTime(s.source, s.epoch + s.time if s.epoch else 0, s.time)


def gps_raw(s: Snapshot) -> Message:
    """Return GPS_RAW_INT (24).

    The receiver is ready before the filter: a 2D fix at one third of the start-up, a 3D fix at two thirds.
    """
    fix = _FIX_3D if s.waking >= 2 / 3 else _FIX_2D if s.waking >= 1 / 3 else _NO_FIX
    if not s.fixed or fix == _NO_FIX:
        nowhere = (0.0, 0.0, 0.0, None, None, None, None, 0)
        return GpsRaw(s.source, s.time, _NO_FIX, *nowhere, 0.0, 0.0, 0.0, 0.0)
    e = s.estimate
    latitude, longitude, altitude = s.origin.geodetic(e.position)
    north, east, _ = e.velocity
    speed = min(math.hypot(north, east), _FASTEST)
    course = math.atan2(east, north) if speed > 0.1 else None
    satellites = _SATELLITES if fix == _FIX_3D else _SATELLITES // 2
    place = latitude, longitude, altitude
    return GpsRaw(s.source, s.time, fix, *place, 0.7, 1.1, speed, course, satellites, altitude, 0.3, 0.4, 0.1)


def attitude_quaternion(s: Snapshot) -> Message:
    """Return ATTITUDE_QUATERNION (31)."""
    e = s.estimate
    return AttitudeQuaternion(s.source, s.time, quaternion(e.roll, e.pitch, e.yaw), e.body_rates)


def mission_current(s: Snapshot) -> Message:
    """Return MISSION_CURRENT (42)."""
    return s.mission()


def vfr_hud(s: Snapshot) -> Message:
    """Return VFR_HUD (74)."""
    e = s.estimate
    north, east, down = e.velocity
    altitude = s.origin.altitude - e.position[2]
    speed = math.hypot(north, east)
    return VfrHud(s.source, speed, speed, altitude, -down, e.yaw % math.tau, s.throttle())


def altitude(s: Snapshot) -> Message | None:
    """Return ALTITUDE (141), or None before the first position."""
    if not s.ready:
        return None
    height = -s.estimate.position[2]
    above_sea = s.origin.altitude + height
    return Altitude(s.source, s.time, height, above_sea, height, above_sea - s.home.altitude, _NAN, _NAN)


def battery_status(s: Snapshot) -> Message | None:
    """Return BATTERY_STATUS (147), or None without a battery."""
    c = s.charge
    if c is None:
        return None
    state = _CRITICAL if c.remaining < _CRITICAL_AT else _LOW if c.remaining < _LOW_AT else _OK
    lasts = min(round(c.lasts), 1_000_000)
    return BatteryStatus(
        s.source, 0, _ALL, _LIPO, (c.voltage,), c.current, c.consumed, c.remaining, lasts, state
    )


def autopilot_version(s: Snapshot) -> Message:
    """Return AUTOPILOT_VERSION (148)."""
    return s.version


def fence_status(s: Snapshot) -> Message:
    """Return FENCE_STATUS (162)."""
    return s.fence(s.source)


def estimator_status(s: Snapshot) -> Message:
    """Return ESTIMATOR_STATUS (230)."""
    good = 0.05 if s.located else _NAN
    # The ratios of this message are squares.
    ratios = good, max(good, s.strain**2), 0.05, 0.05, _NAN, _NAN
    return EstimatorStatus(s.source, s.time, *ratios, 0.3 + s.spread, 0.3, estimator_flags(s))


def home(s: Snapshot) -> Message | None:
    """Return HOME_POSITION (242), or None before the first position."""
    return s.home.report(s.source, s.time) if s.ready or not s.located else None
