"""Sensor profiles: tables of the errors of an autopilot's estimate.

The numbers describe the *output* of the estimator (the values of ATTITUDE and LOCAL_POSITION_NED), not the
sensors. σ is a standard deviation, τ a correlation time. Sources: the project's measured figures
for an EKF-like output (position σ 0.3–0.5 m with τ 30–60 s and 0.02 m white, velocity 0.05–0.1 m/s, roll and
pitch 0.5°, yaw 1–2°, rates 0.01–0.02 rad/s); RTK σ 0.02 m by definition of the profile; the rest as the
descriptions say.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

ProfileName = Literal["truth", "rtk", "gnss", "sih"]

Size = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Time = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class SensorProfile(BaseModel):
    """Errors of an estimate. SI units, radians; zero everywhere is the truth."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    horizontal_drift: Size = Field(0.0, description="σ of the wandering of north and east (m)")
    vertical_drift: Size = Field(
        0.0, description="σ of the wandering of down (m); GNSS is 1.5 times worse there"
    )
    drift_time: Time = Field(45.0, description="τ of the wandering: atmosphere, multipath (s)")
    drift_onset: Time = Field(
        2.0, description="how fast the wandering may turn: the filter's own time constant (s)"
    )
    horizontal_pull: Size = Field(
        0.0,
        description="rate at which the filter pulls north and east back against the velocity (1/s): the"
        " velocity is wrong by the wandering's rate and by its size times this",
    )
    vertical_pull: Size = Field(0.0, description="the same of down (1/s)")
    position_white: Size = Field(0.0, description="σ of what no sample shares with the next, each axis (m)")
    velocity: Size = Field(
        0.0, description="σ of the velocity beyond the wandering's own, each axis (m/s); Doppler"
    )
    velocity_time: Time = Field(0.5, description="τ of that (s); short, so that it adds no drift")
    tilt: Size = Field(0.0, description="σ of roll and of pitch (rad): accelerometer bias")
    tilt_time: Time = Field(20.0, description="τ of roll and pitch (s)")
    yaw: Size = Field(0.0, description="σ of yaw (rad): magnetometer; its walk is bounded by this")
    yaw_time: Time = Field(120.0, description="τ of yaw (s), beyond most flights: a bias that walks")
    rate_bias: Size = Field(0.0, description="σ of the gyro bias that the filter has not found (rad/s)")
    rate_bias_time: Time = Field(300.0, description="τ of the gyro bias (s): temperature")
    rate_white: Size = Field(0.0, description="σ of the noise of the body rates (rad/s)")
    delay: int = Field(
        0,
        ge=0,
        le=100_000,
        description="age of the estimate (µs); not predicted away. The filters' own output predictors carry"
        " their delayed horizon to the newest inertial sample; left are filtering and one cycle of 100 Hz",
    )
    gaps_per_minute: Size = Field(0.0, description="mean number of gaps in the position messages")
    gap_least: Time = Field(0.1, description="shortest gap (s)")
    gap_most: Time = Field(0.4, description="longest gap (s)")

    @property
    def exact(self) -> bool:
        """Whether the motion is estimated without error or delay; gaps in messages do not count."""
        errors = (
            self.horizontal_drift,
            self.vertical_drift,
            self.position_white,
            self.velocity,
            self.tilt,
            self.yaw,
            self.rate_bias,
            self.rate_white,
            self.delay,
        )
        return not any(errors)

    @property
    def worst_axis(self) -> float:
        """Largest σ of a position error along one axis (m)."""
        return math.hypot(max(self.horizontal_drift, self.vertical_drift), self.position_white)

    @property
    def deviation(self) -> float:
        """σ of a position error as a distance (m): all three axes together."""
        white = 3.0 * self.position_white**2
        return math.sqrt(2.0 * self.horizontal_drift**2 + self.vertical_drift**2 + white)


PROFILES: Final[dict[ProfileName, SensorProfile]] = {
    "truth": SensorProfile(),
    "rtk": SensorProfile(
        horizontal_drift=0.018,
        vertical_drift=0.027,
        drift_time=20.0,
        drift_onset=1.0,
        position_white=0.005,
        velocity=0.02,
        tilt=math.radians(0.5),
        yaw=math.radians(1.0),
        rate_bias=0.002,
        rate_white=0.01,
        delay=10_000,
        gaps_per_minute=0.5,
    ),
    "gnss": SensorProfile(
        horizontal_drift=0.4,
        vertical_drift=0.6,
        drift_time=45.0,
        drift_onset=2.0,
        position_white=0.02,
        velocity=0.04,
        tilt=math.radians(0.5),
        yaw=math.radians(1.5),
        rate_bias=0.004,
        rate_white=0.015,
        delay=10_000,
        gaps_per_minute=3.0,
    ),
    # PX4 1.16.1's EKF2 in its simulation SIH, after recorded flights of five vehicles: its velocity is off by
    # 0.1 to 0.3 m/s for seconds, and its position by as much in 0.5 to 0.9 s (1.2 to 1.7 s vertically).
    "sih": SensorProfile(
        horizontal_drift=0.2,
        vertical_drift=0.4,
        drift_time=4.0,
        drift_onset=1.3,
        horizontal_pull=1.3,
        vertical_pull=0.5,
        position_white=0.005,
        velocity=0.03,
        tilt=math.radians(0.5),
        yaw=math.radians(1.0),
        rate_bias=0.002,
        rate_white=0.01,
        delay=10_000,
    ),
}
"""Sensor profiles by name.

Total velocity error: with the drift's own σ/√(τ·onset), 0.004 (rtk) and 0.042 m/s (gnss), ``velocity`` makes
0.02 and 0.058 m/s.
"""
