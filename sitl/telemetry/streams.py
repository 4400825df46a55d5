"""Rates of messages to a ground station: the defaults, and the groups of REQUEST_DATA_STREAM (66)."""

from __future__ import annotations

from typing import Final

from sitl.config.autopilot import AutopilotConfig, TelemetryRates
from sitl.telemetry import inertial_reports as n
from sitl.telemetry import reports as r
from sitl.telemetry import status_reports as q

# A real ArduCopter sends only HEARTBEAT until requested, usually at 4 Hz; but not every script requests.
_ARDUPILOT: Final = TelemetryRates(
    sys_status=2.0,
    attitude=4.0,
    attitude_quaternion=4.0,
    local_position=4.0,
    global_position=4.0,
    gps_global_origin=0.0,
    position_target=2.0,
    extended_sys_state=2.0,
    ekf_status=2.0,
    system_time=1.0,
    gps_raw=2.0,
    mission_current=1.0,
    vfr_hud=4.0,
    battery_status=1.0,
    home_position=0.5,
)
# As recorded of PX4 1.16, with the fast streams slower: a client that needs 50 Hz requests them anyway.
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

ALL: Final = 0
GROUPS: Final[dict[int, tuple[int, ...]]] = {
    1: (n.RAW_IMU,),
    2: (r.SYS_STATUS, q.MISSION_CURRENT, q.GPS_RAW),
    6: (r.GLOBAL_POSITION, r.LOCAL_POSITION),
    10: (r.ATTITUDE,),
    11: (q.VFR_HUD,),
    12: (q.SYSTEM_TIME, q.BATTERY_STATUS, r.EKF_STATUS),
}
"""Message ids of ArduCopter's groups by MAV_DATA_STREAM, as far as they are supported."""


def usual_rates(config: AutopilotConfig) -> TelemetryRates:
    """Return the rates of messages from the start."""
    if config.streams == "quiet":
        return config.rates
    return _ARDUPILOT if config.flavour == "ardupilot" else _PX4


def members(stream: int) -> tuple[int, ...]:
    """Return the message ids of a data stream: those of all streams for 0, none if it is unknown."""
    if stream == ALL:
        return tuple(message_id for group in GROUPS.values() for message_id in group)
    return GROUPS.get(stream, ())
