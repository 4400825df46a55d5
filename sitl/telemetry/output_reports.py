"""Builders of what an autopilot aims at and puts out: targets, odometry, motors, modes, its flight.

A message about which the simulation knows nothing (sticks, the board's supply) is never made up.
"""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    ActuatorOutputs,
    AttitudeTarget,
    FlightInformation,
    Message,
    Odometry,
    PositionTargetGlobal,
    ServoOutput,
    Timesync,
    UtmGlobalPosition,
)
from sitl.telemetry.reports import Snapshot
from sitl.values.attitudes import of_thrust, quaternion
from sitl.values.setpoints import POSITION, mask_of
from sitl.vehicle.ground import GRAVITY

_RATES_IGNORED: Final[int] = (
    mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
    | mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
    | mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE
)
# Pulse widths (µs) at rest and at full speed. PX4's motors get 900 while disarmed, as recorded.
_SLOWEST, _FASTEST, _PX4_DISARMED = 1000, 2000, 900
_UTM_FLAGS: Final[int] = (
    mavlink.UTM_DATA_AVAIL_FLAGS_UAS_ID_AVAILABLE
    | mavlink.UTM_DATA_AVAIL_FLAGS_POSITION_AVAILABLE
    | mavlink.UTM_DATA_AVAIL_FLAGS_ALTITUDE_AVAILABLE
    | mavlink.UTM_DATA_AVAIL_FLAGS_RELATIVE_ALTITUDE_AVAILABLE
    | mavlink.UTM_DATA_AVAIL_FLAGS_HORIZONTAL_VELO_AVAILABLE
    | mavlink.UTM_DATA_AVAIL_FLAGS_VERTICAL_VELO_AVAILABLE
)


def attitude_target(s: Snapshot) -> Message | None:
    """Return ATTITUDE_TARGET (83), or None while nothing is aimed at.

    The attitude is the one that the acceleration of the reference needs; the thrust is the present one. Body
    rates are marked as ignored, because the simulation's controller has no target of its own for them.
    """
    demand = s.demand()
    if demand is None:
        return None
    (north, east, down), yaw = demand
    attitude = of_thrust((north, east, down - GRAVITY), yaw)
    return AttitudeTarget(s.source, s.time, attitude, (0.0, 0.0, 0.0), s.throttle(), _RATES_IGNORED)


def position_target_global(s: Snapshot) -> Message | None:
    """Return POSITION_TARGET_GLOBAL_INT (87), or None if no set-point with a position is followed."""
    target = s.target()
    if target is None or target.levels != (POSITION, POSITION, POSITION):
        return None
    if not s.echoes_yaw:
        target = target._replace(yaw=None, yaw_rate=None)
    px4 = s.autopilot == mavlink.MAV_AUTOPILOT_PX4
    return PositionTargetGlobal(
        s.source,
        s.time,
        *s.origin.geodetic(target.position),
        target.velocity,
        target.acceleration,
        target.yaw or 0.0,
        target.yaw_rate or 0.0,
        mask_of(target),
        mavlink.MAV_FRAME_GLOBAL_INT if px4 else mavlink.MAV_FRAME_GLOBAL,
    )


def odometry(s: Snapshot) -> Message | None:
    """Return ODOMETRY (331) in local NED, as PX4's, or None if not ready or in a drop-out."""
    if not s.ready or s.silent:
        return None
    e, frame = s.estimate, mavlink.MAV_FRAME_LOCAL_NED
    attitude = quaternion(e.roll, e.pitch, e.yaw)
    estimator = mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT
    return Odometry(
        s.source, s.time, e.position, attitude, e.velocity, e.body_rates, frame, frame, 0, estimator
    )


def servo_output(s: Snapshot) -> Message:
    """Return SERVO_OUTPUT_RAW (36)."""
    return ServoOutput(s.source, s.time, 0, _pulses(s))


def actuator_outputs(s: Snapshot) -> Message:
    """Return ACTUATOR_OUTPUT_STATUS (375)."""
    return ActuatorOutputs(s.source, s.time, tuple(map(float, _pulses(s))))


def _pulses(s: Snapshot) -> tuple[int, ...]:
    """Return the motors' pulse widths (µs), linear in the share of the greatest rotor speed."""
    motors = s.motors()
    if not s.armed:
        rest = _PX4_DISARMED if s.autopilot == mavlink.MAV_AUTOPILOT_PX4 else _SLOWEST
        return (rest,) * len(motors)
    return tuple(round(_SLOWEST + (_FASTEST - _SLOWEST) * min(1.0, motor)) for motor in motors)


def timesync(s: Snapshot) -> Message:
    """Return a request of TIMESYNC (111). ArduPilot adds its system id to the nanoseconds."""
    px4 = s.autopilot == mavlink.MAV_AUTOPILOT_PX4
    return Timesync(s.source, 0, s.time * 1000 + (0 if px4 else s.source.system))


def flight_information(s: Snapshot) -> Message:
    """Return FLIGHT_INFORMATION (264)."""
    flight = s.flight
    return FlightInformation(
        s.source, flight.armed_at, flight.took_off_at, flight.count, s.time, flight.landed_at
    )


def utm_global_position(s: Snapshot) -> Message | None:
    """Return UTM_GLOBAL_POSITION (340), or None if not ready or without GPS."""
    if not s.ready or s.silent or not s.fixed:
        return None
    e = s.estimate
    latitude, longitude, altitude = s.origin.geodetic(e.position)
    ground = mavlink.UTM_FLIGHT_STATE_GROUND
    grounded = s.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
    return UtmGlobalPosition(
        s.source,
        s.epoch + s.time if s.epoch else 0,
        latitude,
        longitude,
        altitude,
        altitude - s.home.altitude,
        e.velocity,
        (0.3 + s.spread, 0.4, 0.1),
        s.version.uid2,
        ground if grounded else mavlink.UTM_FLIGHT_STATE_AIRBORNE,
        _UTM_FLAGS | (mavlink.UTM_DATA_AVAIL_FLAGS_TIME_VALID if s.epoch else 0),
    )


def nothing(_s: Snapshot) -> None:
    """Return None: the firmware has this message, the simulation has nothing to say in it."""
