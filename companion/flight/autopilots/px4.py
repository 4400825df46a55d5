"""Profile of PX4: arm, take-off in AUTO, stream of set-points, then OFFBOARD.

The altitude of NAV_TAKEOFF is above mean sea level.
"""

from __future__ import annotations

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.autopilots import Loop, Profile, Step

_HOLD = 4 << 16 | 3 << 24

PX4 = Profile(
    name="PX4",
    autopilot=mavlink.MAV_AUTOPILOT_PX4,
    estimator_message=mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
    steps=(Step.ARM, Step.TAKEOFF, Step.MODE),
    mode_params=(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, 6.0, 0.0),
    guided_custom_mode=6 << 16,
    guided_name="OFFBOARD",
    setpoint_mask=0,
    streams_first=True,
    takeoff_absolute=True,
    hold_params=(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, 4.0, 3.0),
    hold_mode=_HOLD,
    hold_name="HOLD",
    # Auto land, and precision landing.
    land_modes=frozenset((4 << 16 | 6 << 24, 4 << 16 | 9 << 24)),
    # COM_OBL_RC_ACT: position (or descend), hold, return, land.
    fallen_modes=frozenset((3 << 16, _HOLD, 4 << 16 | 5 << 24, 4 << 16 | 6 << 24)),
    loss_modes=frozenset((_HOLD,)),
    takeoff_modes=frozenset((4 << 16 | 2 << 24,)),
    # MPC_XY_P and MPC_XY_VEL_P_ACC. The position loop has no integral: an error of 0.3 m/s in the estimated
    # velocity causes a position error of 0.3 m. The derivative is MPC_XY_VEL_D_ACC.
    loop=Loop(0.95, 1.8, 4.0, offset_s=0.5, lead_us=180_000, pull=0.5, derivative=0.2),
    bytewise=True,
)
