"""Builders of the telemetry messages that companions need: a snapshot in, a message out.

``status_reports`` has the other messages.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

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
)
from sitl.estimation.sensors import Estimate
from sitl.values.home import Home
from sitl.values.origin import Origin
from sitl.values.setpoints import LOCAL_NED, Setpoint, mask_of
from sitl.vehicle.battery import Charge
from sitl.vehicle.multirotor import VehicleState

HEARTBEAT: Final = 0
SYS_STATUS: Final = 1
ATTITUDE: Final = 30
LOCAL_POSITION: Final = 32
GLOBAL_POSITION: Final = 33
ORIGIN: Final = 49
POSITION_TARGET: Final = 85
EKF_STATUS: Final = 193
EXTENDED_SYS_STATE: Final = 245

ON_GROUND: Final = 1
IN_AIR: Final = 2
TAKING_OFF: Final = 3
LANDING: Final = 4

# MAV_TYPE by the number of rotors, else generic
_TYPES: Final = {4: 2, 6: 13, 8: 14}
_STANDBY: Final = 3
_ACTIVE: Final = 4
_CALIBRATING: Final = 2
_CRITICAL: Final = 5

# MAV_SYS_STATUS_SENSOR: gyro, accelerometer, magnetometer, barometer; control of rate, attitude, yaw, height
# and position; motors, AHRS. GPS and the prearm check wait for a position.
_SENSORS: Final = 0x1 | 0x2 | 0x4 | 0x8 | 0x400 | 0x800 | 0x1000 | 0x2000 | 0x4000 | 0x8000 | 0x200000
_GPS: Final = 0x20
_PREARM: Final = 0x10000000
_BATTERY: Final = 0x2000000

# ESTIMATOR_STATUS_FLAGS: attitude, velocities, relative and absolute position, and their predictions.
_EKF_READY: Final = 0x1 | 0x2 | 0x4 | 0x8 | 0x10 | 0x20 | 0x100 | 0x200
_EKF_WAITING: Final = 0x1 | 0x80 | 0x400
# Without GPS for too long: attitude, vertical velocity and height by barometer, constant position assumed.
_EKF_LOST: Final = 0x1 | 0x4 | 0x20 | 0x80
# Innovation over gate of a healthy filter.
_TESTED: Final = 0.05


class Snapshot(NamedTuple):
    """Inputs of all telemetry messages.

    ``time`` since boot (µs); ``base_mode`` with the armed bit; ``target`` returns the set-point that is
    followed now, or None. ``located``: the estimator has a position or waits for its first; ``fixed``: there
    is GPS; ``strain``, ``spread``: those of ``Positioning``; ``silent``: position messages drop out.
    ``waking`` 0…1: start-up progress of GPS and filter, if that is shown; ``charge`` None without a battery;
    ``throttle`` 0…1; ``unbreached``: MAV_SYS_STATUS_GEOFENCE where it is reported; ``epoch``: Unix time of
    the boot (µs), 0 if unknown; ``version``: AUTOPILOT_VERSION; ``mission`` returns MISSION_CURRENT,
    ``fence`` FENCE_STATUS. ``armable``: there is no objection to arming, or it is armed. ``lift``: specific
    force of the rotors, or of the ground (m/s²); ``truth``: the true state, site NED.
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
    strain: float
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


def heartbeat(s: Snapshot) -> Message:
    """Return HEARTBEAT (0)."""
    idle = _STANDBY if s.ready else _CALIBRATING
    flying = _ACTIVE if s.located else _CRITICAL
    state = flying if s.armed else idle
    return Heartbeat(s.source, _TYPES.get(s.rotors, 0), s.autopilot, s.base_mode, s.custom_mode, state)


def sys_status(s: Snapshot) -> Message:
    """Return SYS_STATUS (1)."""
    known = _SENSORS | _GPS | _PREARM
    health = (known if s.ready else _SENSORS) & ~(0 if s.fixed else _GPS) | s.unbreached
    if not s.armable:
        health &= ~_PREARM
    if s.charge is None:
        return SysStatus(s.source, known, known, health, None, None)
    known |= _BATTERY
    return SysStatus(s.source, known, known, health | _BATTERY, s.charge.voltage, s.charge.remaining)


def attitude(s: Snapshot) -> Message:
    """Return ATTITUDE (30)."""
    e = s.estimate
    return Attitude(s.source, s.time, e.roll, e.pitch, e.yaw, e.body_rates)


def local_position(s: Snapshot) -> Message | None:
    """Return LOCAL_POSITION_NED (32), or None without a position or in a drop-out."""
    if not s.ready or s.silent:
        return None
    return LocalPosition(s.source, s.time, s.estimate.position, s.estimate.velocity)


def global_position(s: Snapshot) -> Message | None:
    """Return GLOBAL_POSITION_INT (33), or None without a position or in a drop-out."""
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
        LOCAL_NED,
        mask_of(target),
        target.position,
        target.velocity,
        target.acceleration,
        target.yaw or 0.0,
        target.yaw_rate or 0.0,
    )


def ekf_status(s: Snapshot) -> Message:
    """Return EKF_STATUS_REPORT (193)."""
    good = _TESTED if s.located else 0.0
    return EkfStatus(s.source, estimator_flags(s), good, max(good, s.strain), _TESTED, _TESTED)


def estimator_flags(s: Snapshot) -> int:
    """Return ESTIMATOR_STATUS_FLAGS.

    While ``waking``: attitude at once, vertical velocity and height from a third, horizontal velocity and
    relative position from two thirds.
    """
    if s.ready or not s.located:
        return _EKF_READY if s.ready else _EKF_LOST
    if s.waking < 1 / 3:
        return _EKF_WAITING
    return _EKF_WAITING | 0x4 | 0x20 if s.waking < 2 / 3 else _EKF_WAITING | 0x2 | 0x4 | 0x8 | 0x20


def extended_sys_state(s: Snapshot) -> Message:
    """Return EXTENDED_SYS_STATE (245)."""
    return ExtendedSysState(s.source, 0, s.landed_state)


Build = Callable[[Snapshot], Message | None]
"""Builds one message, or returns None if it has no content yet."""
