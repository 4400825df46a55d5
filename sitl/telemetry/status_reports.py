"""Builders of further telemetry for ground stations: GPS, battery, home, mission, version, estimator."""

from __future__ import annotations

import math
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    Altitude,
    AttitudeQuaternion,
    AutopilotVersion,
    BatteryStatus,
    EstimatorStatus,
    GpsRaw,
    Message,
    Source,
    SystemTime,
    VfrHud,
)
from sitl.telemetry.reports import Snapshot, estimator_flags
from sitl.values.attitudes import quaternion

_SATELLITES: Final = 12
# Shares of the charge below which the battery is reported as low or critical.
_LOW_AT, _CRITICAL_AT = 0.15, 0.07
# Limit of the speed field of GPS_RAW_INT.
_MAX_SPEED_M_S: Final = 655.0
_NAN: Final = math.nan
# Capabilities of both firmwares. Terrain and compass calibration are not supported.
_CAPABILITIES: Final = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_FTP
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_FLIGHT_TERMINATION
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
)

# Four bytes: major, minor, patch, and 255 for an official release. ArduCopter 4.6.3, PX4 1.16.1.
_VERSIONS: Final = {"ardupilot": 0x040603FF, "px4": 0x011001FF}
_NAME: Final = b"outrider"


def system_time(s: Snapshot) -> Message:
    """Return SYSTEM_TIME (2)."""
    return SystemTime(s.source, s.epoch + s.time if s.epoch else 0, s.time)


def gps_raw(s: Snapshot) -> Message:
    """Return GPS_RAW_INT (24).

    The receiver is ready before the filter: a 2D fix at one third of the start-up, a 3D fix at two thirds.
    """
    if not s.fixed or s.waking < 1 / 3:
        nowhere = (0.0, 0.0, 0.0, None, None, None, None, 0)
        return GpsRaw(s.source, s.time, mavlink.GPS_FIX_TYPE_NO_FIX, *nowhere, 0.0, 0.0, 0.0, 0.0)
    if s.waking < 2 / 3:
        fix, satellites = mavlink.GPS_FIX_TYPE_2D_FIX, _SATELLITES // 2
    else:
        fix, satellites = mavlink.GPS_FIX_TYPE_3D_FIX, _SATELLITES
    e = s.estimate
    latitude, longitude, altitude = s.origin.geodetic(e.position)
    north, east, _ = e.velocity
    speed = min(math.hypot(north, east), _MAX_SPEED_M_S)
    course = math.atan2(east, north) if speed > 0.1 else None
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
    """Return ALTITUDE (141), or None if not ready."""
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
    state = mavlink.MAV_BATTERY_CHARGE_STATE_OK
    if c.remaining < _CRITICAL_AT:
        state = mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL
    elif c.remaining < _LOW_AT:
        state = mavlink.MAV_BATTERY_CHARGE_STATE_LOW
    kind = mavlink.MAV_BATTERY_FUNCTION_ALL, mavlink.MAV_BATTERY_TYPE_LIPO
    lasts = min(round(c.lasts), 1_000_000)
    return BatteryStatus(s.source, 0, *kind, (c.voltage,), c.current, c.consumed, c.remaining, lasts, state)


def autopilot_version(s: Snapshot) -> Message:
    """Return AUTOPILOT_VERSION (148)."""
    return s.version


def version(source: Source, flavour: str) -> AutopilotVersion:
    """Return AUTOPILOT_VERSION (148) of ``flavour``.

    The version is that of the emulated firmware. The uid contains the system id, so that it is unique; the
    eight bytes of ``flight_custom``, usually a version control hash, are "outrider".
    """
    capabilities = _CAPABILITIES
    if flavour == "px4":
        capabilities |= mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    uid = int.from_bytes(_NAME[:7] + bytes((source.system,)), "big")
    uid2 = (_NAME + bytes((source.system,))).ljust(18, b"\0")
    number = _VERSIONS[flavour]
    return AutopilotVersion(source, capabilities, uid, number, 0, 0, 0, 0, 0, _NAME, bytes(8), bytes(8), uid2)


def fence_status(s: Snapshot) -> Message:
    """Return FENCE_STATUS (162)."""
    return s.fence(s.source)


def estimator_status(s: Snapshot) -> Message:
    """Return ESTIMATOR_STATUS (230)."""
    good = 0.05 if s.located else _NAN
    # The ratios of this message are squares.
    ratios = good, max(good, s.test_ratio**2), 0.05, 0.05, _NAN, _NAN
    return EstimatorStatus(s.source, s.time, *ratios, 0.3 + s.spread, 0.3, estimator_flags(s))


def home(s: Snapshot) -> Message | None:
    """Return HOME_POSITION (242), or None before the first position."""
    return s.home.report(s.source, s.time) if s.ready or not s.located else None
