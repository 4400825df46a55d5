"""Builders of the telemetry messages that companions need: a snapshot in, a message out.

``status_reports`` and ``inertial_reports`` have the other messages.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    Attitude,
    AutopilotVersion,
    EkfStatus,
    ExtendedSysState,
    FenceStatus,
    GlobalPosition,
    GpsGlobalOrigin,
    Heartbeat,
    LocalPosition,
    Message,
    MissionCurrent,
    PositionTarget,
    Source,
    SysStatus,
    Vector,
)
from sitl.estimation.sensors import Estimate
from sitl.values.home import Home
from sitl.values.origin import Origin
from sitl.values.setpoints import Setpoint, mask_of
from sitl.vehicle.battery import Charge
from sitl.vehicle.multirotor import VehicleState

TYPES: Final = {
    4: mavlink.MAV_TYPE_QUADROTOR,
    6: mavlink.MAV_TYPE_HEXAROTOR,
    8: mavlink.MAV_TYPE_OCTOROTOR,
}
"""MAV_TYPE by the number of rotors; others are generic."""

# Healthy from the start, unlike GPS and the pre-arm check.
_SENSORS: Final = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_ANGULAR_RATE_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_ATTITUDE_STABILIZATION
    | mavlink.MAV_SYS_STATUS_SENSOR_YAW_POSITION
    | mavlink.MAV_SYS_STATUS_SENSOR_Z_ALTITUDE_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_AHRS
)

_EKF_READY: Final[int] = (
    mavlink.EKF_ATTITUDE
    | mavlink.EKF_VELOCITY_HORIZ
    | mavlink.EKF_VELOCITY_VERT
    | mavlink.EKF_POS_HORIZ_REL
    | mavlink.EKF_POS_HORIZ_ABS
    | mavlink.EKF_POS_VERT_ABS
    | mavlink.EKF_PRED_POS_HORIZ_REL
    | mavlink.EKF_PRED_POS_HORIZ_ABS
)
_EKF_WAITING: Final[int] = mavlink.EKF_ATTITUDE | mavlink.EKF_CONST_POS_MODE
# Added after one third, and after two thirds, of the start-up.
_EKF_VERTICAL: Final[int] = mavlink.EKF_VELOCITY_VERT | mavlink.EKF_POS_VERT_ABS
_EKF_HORIZONTAL: Final[int] = mavlink.EKF_VELOCITY_HORIZ | mavlink.EKF_POS_HORIZ_REL
# Without GPS for too long: attitude, and height by barometer.
_EKF_LOST: Final[int] = mavlink.EKF_ATTITUDE | _EKF_VERTICAL | mavlink.EKF_CONST_POS_MODE
# Innovation test ratio (innovation over gate) of a healthy filter.
_HEALTHY_RATIO: Final = 0.05


class Flight(Protocol):
    """Times of the present or last flight (µs since boot, 0 for none), and the number of flights."""

    armed_at: int
    took_off_at: int
    landed_at: int
    count: int


class Snapshot(NamedTuple):
    """Inputs of all telemetry messages.

    ``time`` since boot (µs); ``base_mode`` with the armed bit; ``target`` returns the set-point that is
    followed now, or None. ``located``: the estimator has not lost its position (true before the first
    one); ``fixed``: there is GPS; ``test_ratio``: innovation test ratio of the position; ``spread``: σ
    (m) of the position added since the loss of GPS; ``silent``: position messages drop out. ``waking``
    0…1: progress of the reported start-up of GPS and filter; ``charge`` None without a battery;
    ``throttle`` 0…1; ``unbreached``: MAV_SYS_STATUS_GEOFENCE, or 0 if the fence is breached or not
    reported; ``epoch``: Unix time of the boot (µs), 0 if unknown; ``version``: AUTOPILOT_VERSION;
    ``mission`` returns MISSION_CURRENT, ``fence`` FENCE_STATUS. ``armable``: ready, and armed or without
    objection to arming. ``lift``: specific force of the rotors, or of the ground (m/s²); ``truth``: the
    true state, site NED. ``demand`` returns the acceleration (m/s², local NED) and yaw (rad) that the
    controller aims at, or None; ``motors`` the rotor speeds over the greatest one; ``flight``: its times.
    """

    source: Source
    time: int
    estimate: Estimate
    origin: Origin
    ready: bool
    armed: bool
    rotors: int
    autopilot: int
    base_mode: int
    custom_mode: int
    landed_state: int
    target: Callable[[], Setpoint | None]
    echoes_yaw: bool
    located: bool
    fixed: bool
    test_ratio: float
    spread: float
    silent: bool
    waking: float
    home: Home
    charge: Charge | None
    throttle: Callable[[], float]
    unbreached: int
    epoch: int
    version: AutopilotVersion
    mission: Callable[[], MissionCurrent]
    armable: bool
    fence: Callable[[Source], FenceStatus]
    lift: Callable[[], float]
    truth: Callable[[], VehicleState]
    demand: Callable[[], tuple[Vector, float] | None]
    motors: Callable[[], tuple[float, ...]]
    flight: Flight


def heartbeat(s: Snapshot) -> Message:
    """Return HEARTBEAT (0)."""
    idle = mavlink.MAV_STATE_STANDBY if s.ready else mavlink.MAV_STATE_CALIBRATING
    flying = mavlink.MAV_STATE_ACTIVE if s.located else mavlink.MAV_STATE_CRITICAL
    state = flying if s.armed else idle
    kind = TYPES.get(s.rotors, mavlink.MAV_TYPE_GENERIC)
    return Heartbeat(s.source, kind, s.autopilot, s.base_mode, s.custom_mode, state)


def sys_status(s: Snapshot) -> Message:
    """Return SYS_STATUS (1)."""
    gps, battery = mavlink.MAV_SYS_STATUS_SENSOR_GPS, mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    known = _SENSORS | gps | mavlink.MAV_SYS_STATUS_PREARM_CHECK
    health = (known if s.ready else _SENSORS) & ~(0 if s.fixed else gps) | s.unbreached
    if not s.armable:
        health &= ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
    if s.charge is None:
        return SysStatus(s.source, known, known, health, None, None)
    known |= battery
    return SysStatus(s.source, known, known, health | battery, s.charge.voltage, s.charge.remaining)


def attitude(s: Snapshot) -> Message:
    """Return ATTITUDE (30)."""
    e = s.estimate
    return Attitude(s.source, s.time, e.roll, e.pitch, e.yaw, e.body_rates)


def local_position(s: Snapshot) -> Message | None:
    """Return LOCAL_POSITION_NED (32), or None if not ready or in a drop-out."""
    if not s.ready or s.silent:
        return None
    return LocalPosition(s.source, s.time, s.estimate.position, s.estimate.velocity)


def global_position(s: Snapshot) -> Message | None:
    """Return GLOBAL_POSITION_INT (33), or None if not ready or in a drop-out."""
    if not s.ready or s.silent:
        return None
    e, origin = s.estimate, s.origin
    latitude, longitude, altitude = origin.geodetic(e.position)
    return GlobalPosition(
        s.source, s.time, latitude, longitude, altitude, altitude - s.home.altitude, e.velocity, e.yaw
    )


def origin(s: Snapshot) -> Message | None:
    """Return GPS_GLOBAL_ORIGIN (49), or None before the first position."""
    o = s.origin
    known = s.ready or not s.located
    return GpsGlobalOrigin(s.source, o.latitude, o.longitude, o.altitude, s.time) if known else None


def position_target(s: Snapshot) -> Message | None:
    """Return POSITION_TARGET_LOCAL_NED (85), or None if no set-point is followed."""
    target = s.target()
    if target is None:
        return None
    if not s.echoes_yaw:
        target = target._replace(yaw=None, yaw_rate=None)
    return PositionTarget(
        s.source,
        s.time,
        mavlink.MAV_FRAME_LOCAL_NED,
        mask_of(target),
        target.position,
        target.velocity,
        target.acceleration,
        target.yaw or 0.0,
        target.yaw_rate or 0.0,
    )


def ekf_status(s: Snapshot) -> Message:
    """Return EKF_STATUS_REPORT (193)."""
    good = _HEALTHY_RATIO if s.located else 0.0
    # Not in ``estimator_flags``, because in ESTIMATOR_STATUS this bit means a GPS glitch.
    waits = 0 if s.ready or not s.located else mavlink.EKF_UNINITIALIZED
    return EkfStatus(
        s.source, estimator_flags(s) | waits, good, max(good, s.test_ratio), _HEALTHY_RATIO, _HEALTHY_RATIO
    )


def estimator_flags(s: Snapshot) -> int:
    """Return the flags that EKF_STATUS_FLAGS and ESTIMATOR_STATUS_FLAGS have in common.

    During start-up: attitude at once, vertical velocity and height from one third of ``waking`` on,
    horizontal velocity and relative position from two thirds on.
    """
    if s.ready or not s.located:
        return _EKF_READY if s.ready else _EKF_LOST
    if s.waking < 1 / 3:
        return _EKF_WAITING
    horizontal = 0 if s.waking < 2 / 3 else _EKF_HORIZONTAL
    return _EKF_WAITING | _EKF_VERTICAL | horizontal


def extended_sys_state(s: Snapshot) -> Message:
    """Return EXTENDED_SYS_STATE (245)."""
    return ExtendedSysState(s.source, mavlink.MAV_VTOL_STATE_UNDEFINED, s.landed_state)


Build = Callable[[Snapshot], Message | None]
"""Builder of one message; returns None if there is nothing to send."""
