"""Rates of messages to a ground station: the defaults, and the groups of REQUEST_DATA_STREAM (66)."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from sitl.config.autopilot import AutopilotConfig, TelemetryRates

# ArduCopter's SRn_ parameters are 0, so every other message waits for a request; sim_vehicle.py appears to
# stream because MAVProxy requests 4 Hz.
_ARDUPILOT: Final = TelemetryRates(
    **{name: 1.0 if name == "heartbeat" else 0.0 for name in TelemetryRates.model_fields}
)
# As recorded from PX4 1.16, but with lower rates of the fast streams: a client that needs 50 Hz requests it.
_PX4: Final = TelemetryRates(
    sys_status=5.0,
    attitude=20.0,
    attitude_quaternion=20.0,
    local_position=20.0,
    global_position=10.0,
    gps_global_origin=0.2,
    position_target=10.0,
    extended_sys_state=5.0,
    system_time=1.0,
    gps_raw=5.0,
    mission_current=1.0,
    vfr_hud=10.0,
    battery_status=0.5,
    home_position=0.5,
    altitude=10.0,
    estimator_status=1.0,
)

# As recorded, beside the messages of ``TelemetryRates``; ODOMETRY with a third of its rate.
_FURTHER: Final[dict[str, dict[int, float]]] = {
    "ardupilot": {},
    "px4": {
        mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 10.0,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: 10.0,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: 10.0,
        mavlink.MAVLINK_MSG_ID_ODOMETRY: 10.0,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: 1.0,
        mavlink.MAVLINK_MSG_ID_CURRENT_MODE: 0.5,
    },
}
_TIMESYNC: Final = {"ardupilot": 0.1, "px4": 10.0}

GROUPS: Final[dict[int, tuple[int, ...]]] = {
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: (
        mavlink.MAVLINK_MSG_ID_RAW_IMU,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE,
    ),
    mavlink.MAV_DATA_STREAM_RC_CHANNELS: (
        mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
        mavlink.MAVLINK_MSG_ID_RC_CHANNELS,
    ),
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
    ),
    mavlink.MAV_DATA_STREAM_POSITION: (
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (mavlink.MAVLINK_MSG_ID_ATTITUDE,),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    ),
}
"""Message ids of ArduCopter's groups by MAV_DATA_STREAM, as far as they are supported."""


def usual_rates(config: AutopilotConfig) -> TelemetryRates:
    """Return the rates of messages before any request."""
    if config.streams == "quiet":
        return config.rates
    return _PX4 if config.flavour == "px4" else _ARDUPILOT


def further_rates(config: AutopilotConfig) -> tuple[dict[int, float], float] | None:
    """Return the rates (Hz) by id of what firmware streams besides, and TIMESYNC's; None in quiet flights."""
    if config.streams == "quiet":
        return None
    return _FURTHER[config.flavour], _TIMESYNC[config.flavour]


def members(stream: int) -> tuple[int, ...]:
    """Return the message ids of a data stream: those of all streams for 0, none if it is unknown."""
    if stream == mavlink.MAV_DATA_STREAM_ALL:
        return tuple(message_id for group in GROUPS.values() for message_id in group)
    return GROUPS.get(stream, ())
