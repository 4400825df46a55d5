"""How often messages go out to a ground station: by default, and by REQUEST_DATA_STREAM (66)."""

from __future__ import annotations

from typing import Final

from sitl.config.autopilot import AutopilotConfig, TelemetryRates
from sitl.telemetry import inertial_reports as n
from sitl.telemetry import reports as r
from sitl.telemetry import status_reports as q

# A real ArduCopter tells nothing but HEARTBEAT until it is asked, at 4 Hz as a rule; not every script asks.
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
# As recorded of PX4 1.16, the fast ones slower: nobody who needs 50 Hz is short of asking.
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
"""By MAV_DATA_STREAM, what ArduCopter has in each of its groups, as far as we have it."""


def usual_rates(config: AutopilotConfig) -> TelemetryRates:
    """What flows from the start."""
    if config.streams == "quiet":
        return config.rates
    return _ARDUPILOT if config.flavour == "ardupilot" else _PX4


def members(stream: int) -> tuple[int, ...]:
    """The message ids of a data stream; of all for 0, none if it is unknown."""
    if stream == ALL:
        return tuple(message_id for group in GROUPS.values() for message_id in group)
    return GROUPS.get(stream, ())
