"""Profile of ArduCopter: GUIDED, arm, NAV_TAKEOFF above home, then set-points.

The set-points have all five parts, with which it was measured to follow best.
"""

from __future__ import annotations

from companion.flight.autopilots import Loop, Profile, Shaping, Step

ARDUPILOT = Profile(
    name="ArduPilot",
    autopilot=3,
    estimator_message=193,
    steps=(Step.MODE, Step.ARM, Step.TAKEOFF),
    mode_params=(1.0, 4.0, 0.0),
    guided_custom_mode=4,
    guided_name="GUIDED",
    setpoint_mask=0,
    streams_first=False,
    takeoff_absolute=False,
    hold_params=(1.0, 17.0, 0.0),
    hold_mode=17,
    hold_name="BRAKE",
    land_modes=frozenset((9,)),
    # PSC_POSXY_P and PSC_VELXY_P; the slew is low because plans use most of PSC_JERK_XY, 5 m/s³. The
    # trajectory's gains are the jerk over WPNAV_ACCEL, 2.5 m/s², and half of that.
    loop=Loop(1.0, 2.0, 1.0, Shaping(jerk=5.0, position=1.0, velocity=2.0)),
)
