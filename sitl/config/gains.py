"""Parameters of the firmwares' position controllers, with the firmware's own defaults. SI units, radians."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

ResponseName = Literal["exact", "firmware"]

Positive = Annotated[float, Field(gt=0.0, le=1000.0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0.0, le=1000.0, allow_inf_nan=False)]
Tilt = Annotated[float, Field(gt=0.0, le=math.radians(89.5), allow_inf_nan=False)]


class ArduPilotGains(BaseModel):
    """Position controller of ArduCopter's GUIDED mode."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    jerk: Positive = Field(5.0, description="PSC_JERK_XY, m/s³")
    acceleration: Positive = Field(2.5, description="WPNAV_ACCEL, m/s²: of corrections")
    position: Positive = Field(1.0, description="PSC_POSXY_P, 1/s")
    velocity: Positive = Field(2.0, description="PSC_VELXY_P, 1/s")
    integral: Share = Field(1.0, description="PSC_VELXY_I, 1/s²")
    derivative: Share = Field(0.25, description="PSC_VELXY_D")
    filter_hz: Positive = Field(5.0, description="PSC_VELXY_FLTE and PSC_VELXY_FLTD, Hz")
    tilt: Tilt = Field(math.radians(30.0), description="ANGLE_MAX, rad")
    jerk_z: Positive = Field(5.0, description="PSC_JERK_Z, m/s³")
    acceleration_z: Positive = Field(1.0, description="WPNAV_ACCEL_Z, m/s²: of corrections")
    position_z: Positive = Field(1.0, description="PSC_POSZ_P, 1/s")
    velocity_z: Positive = Field(5.0, description="PSC_VELZ_P, 1/s")
    filter_z_hz: Positive = Field(5.0, description="PSC_VELZ_FLTE, Hz")
    throttle: Positive = Field(0.5, description="PSC_ACCZ_P, thousandths of the throttle per cm/s²")
    throttle_integral: Share = Field(1.0, description="PSC_ACCZ_I, the same per s")
    throttle_filter_hz: Positive = Field(20.0, description="PSC_ACCZ_FLTE, Hz")


class Speeds(NamedTuple):
    """Speed limits of ArduCopter's corrections (m/s).

    They are the parameters of its missions: WPNAV_SPEED, WPNAV_SPEED_UP and WPNAV_SPEED_DN.
    """

    level: float = 10.0
    up: float = 2.5
    down: float = 1.5


class Px4Gains(BaseModel):
    """Position controller of PX4's OFFBOARD mode."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    speed: Share = Field(12.0, description="MPC_XY_VEL_MAX, m/s")
    position: Share = Field(0.95, description="MPC_XY_P, 1/s")
    velocity: Positive = Field(1.8, description="MPC_XY_VEL_P_ACC, 1/s")
    integral: Share = Field(0.4, description="MPC_XY_VEL_I_ACC, 1/s²")
    derivative: Share = Field(0.2, description="MPC_XY_VEL_D_ACC")
    filter_hz: Positive = Field(5.0, description="MPC_VELD_LP, Hz")
    tilt: Tilt = Field(math.radians(45.0), description="MPC_TILTMAX_AIR, rad")
    speed_up: Positive = Field(3.0, description="MPC_Z_VEL_MAX_UP, m/s")
    speed_down: Positive = Field(1.5, description="MPC_Z_VEL_MAX_DN, m/s")
    position_z: Share = Field(1.0, description="MPC_Z_P, 1/s")
    velocity_z: Positive = Field(4.0, description="MPC_Z_VEL_P_ACC, 1/s")
    integral_z: Share = Field(2.0, description="MPC_Z_VEL_I_ACC, 1/s²")
