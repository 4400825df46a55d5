"""ArduCopter: GUIDED, arm, NAV_TAKEOFF above home, then set-points with all five parts (measured as its
best)."""

from __future__ import annotations

from companion.autopilots import Profile, Step

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
)
