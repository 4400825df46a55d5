"""Profile of ArduCopter: GUIDED, arm, NAV_TAKEOFF above home, then set-points.

The set-points contain position, velocity, acceleration, yaw and yaw rate: in measurements, ArduCopter
followed these best.
"""

from __future__ import annotations

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.autopilots import Inverse, Loop, Profile, Shaping, Step

ARDUPILOT = Profile(
    name="ArduPilot",
    autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    estimator_message=mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    steps=(Step.MODE, Step.ARM, Step.TAKEOFF),
    mode_params=(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, mavlink.COPTER_MODE_GUIDED, 0.0),
    guided_custom_mode=mavlink.COPTER_MODE_GUIDED,
    guided_name="GUIDED",
    setpoint_mask=0,
    streams_first=False,
    takeoff_absolute=False,
    hold_params=(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, mavlink.COPTER_MODE_BRAKE, 0.0),
    hold_mode=mavlink.COPTER_MODE_BRAKE,
    hold_name="BRAKE",
    land_modes=frozenset((mavlink.COPTER_MODE_LAND,)),
    # PSC_POSXY_P and PSC_VELXY_P; the slew is low because plans use most of PSC_JERK_XY, 5 m/s³. The
    # trajectory's gains are the jerk over WPNAV_ACCEL, 2.5 m/s², and half of that. The integral is
    # PSC_VELXY_I; the lag of the attitude is ATC_INPUT_TC, 0.15 s, and that of the rate loop.
    loop=Loop(
        1.0,
        2.0,
        1.0,
        Shaping(jerk=5.0, position=1.0, velocity=2.0),
        inverse=Inverse(integral=1.0, lag_us=180_000),
    ),
)
