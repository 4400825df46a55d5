"""Settings of one emulated autopilot: identity, starting place, telemetry rates, autonomous behaviour."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from sitl.backends.physics import PhysicsName
from sitl.config.autonomy import BatteryFailsafeConfig, FenceConfig, FollowConfig
from sitl.config.gains import ArduPilotGains, Px4Gains, ResponseName
from sitl.estimation.profiles import ProfileName
from sitl.vehicle.battery import BatteryConfig

Rate = Annotated[float, Field(ge=0.0, le=1000.0)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Seconds = Annotated[float, Field(ge=0.0, le=3600.0)]


class TelemetryRates(BaseModel):
    """Messages per second sent from the start, 0 for none; SET_MESSAGE_INTERVAL (511) changes them.

    A real ArduCopter streams only HEARTBEAT and STATUSTEXT until requested. By default these rates provide
    all that a companion needs.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    heartbeat: Rate = 1.0
    sys_status: Rate = 1.0
    attitude: Rate = 50.0
    local_position: Rate = 50.0
    global_position: Rate = 10.0
    gps_global_origin: Rate = 0.2
    position_target: Rate = 10.0
    extended_sys_state: Rate = 2.0
    ekf_status: Rate = 1.0
    system_time: Rate = 0.0
    gps_raw: Rate = 0.0
    attitude_quaternion: Rate = 0.0
    mission_current: Rate = 0.0
    vfr_hud: Rate = 0.0
    battery_status: Rate = 0.0
    home_position: Rate = 0.0
    altitude: Rate = 0.0
    estimator_status: Rate = 0.0


class AutopilotConfig(BaseModel):
    """One emulated autopilot. SI units; angles in radians; latitude and longitude in degrees."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    system_id: int = Field(ge=1, le=255)
    flavour: Literal["ardupilot", "px4"] = "ardupilot"
    latitude: float = Field(ge=-90.0, le=90.0)
    longitude: float = Field(ge=-180.0, le=180.0)
    altitude: FiniteFloat = Field(0.0, description="of the ground at the start, m above mean sea level")
    yaw: FiniteFloat = Field(0.0, description="at the start, clockwise from north")
    rates: TelemetryRates = TelemetryRates()
    streams: Literal["quiet", "normal"] = Field(
        "quiet",
        description="quiet: ``rates``, what companions need; normal: what the firmware streams unasked:"
        " PX4 all that ground stations need, ArduPilot HEARTBEAT, and TIMESYNC every 10 s",
    )
    sensors: ProfileName = Field(
        "truth", description="how good its estimate is: truth, rtk, gnss or sih (PX4's own simulation)"
    )
    physics: PhysicsName = Field("own", description="what moves the vehicle: our own integrator, or JSBSim")
    response: ResponseName = Field(
        "exact",
        description="exact: it is where its set-points say; firmware: where the firmware's position"
        " controller flies the airframe of its own simulator",
    )
    ardupilot: ArduPilotGains = Field(ArduPilotGains(), description="of its position controller")
    px4: Px4Gains = Field(Px4Gains(), description="of its position controller")
    start_height: float = Field(
        0.0,
        ge=0.0,
        le=1000.0,
        description="above the ground at the start (m); if not 0 it begins armed, hovering in GUIDED or HOLD",
    )

    ready_after: Seconds = Field(1.0, description="from boot until position is known and arming is allowed")
    startup: Literal["at once", "in stages"] = Field(
        "at once", description="whether GPS and estimator are seen to come up before ``ready_after``"
    )
    epoch: int = Field(0, ge=0, description="Unix time of the boot (µs); 0: it does not know the time")
    epoch_from_steps: bool = Field(
        False, description="the times of steps are Unix times, so the first one is ``epoch``"
    )
    utc_error_us: int = Field(
        0, ge=-600_000_000, le=600_000_000, description="by which its UTC is ahead when it is set, µs"
    )
    clock_drift_ppm: float = Field(
        0.0,
        ge=-10_000.0,
        le=10_000.0,
        description="by which its clock is fast; its time since boot and its UTC both run on it",
    )
    battery: BatteryConfig | None = Field(None, description="none: its state is not told")
    battery_failsafe: BatteryFailsafeConfig = BatteryFailsafeConfig()
    fence: FenceConfig = FenceConfig()
    follow: FollowConfig = FollowConfig()
    disarm_delay: Seconds = Field(10.0, description="armed on the ground for this long: disarmed again")
    touchdown_time: Seconds = Field(0.5, description="on the ground for this long: landed")

    takeoff_height: Positive = Field(2.5, description="when NAV_TAKEOFF does not say (PX4)")
    takeoff_speed: Positive = 1.5
    land_speed: Positive = 0.8
    max_speed: Positive = Field(10.0, description="of every reference, norm")
    max_acceleration: Positive = Field(8.0, description="of every reference, norm")
    max_jerk: Positive = Field(40.0, description="of shaped references, norm")
    gentle_acceleration: Positive = Field(1.5, description="for takeoff, landing, braking into a hold")
    max_yaw_rate: Positive = math.radians(180.0)
    max_yaw_acceleration: Positive = Field(2.4, description="the firefly's yaw torque gives 2.5 rad/s²")

    waypoint_speed: Positive = Field(
        5.0, description="in missions and on the way home, norm; ArduPilot's, if it is not said, is 10"
    )
    waypoint_climb: Positive = 2.5
    waypoint_sink: Positive = 1.5
    acceptance_radius: Positive = Field(2.0, description="a waypoint is reached this near")
    return_height: float = Field(
        15.0, ge=0.0, le=3000.0, description="above home, at least, on the way home (m)"
    )
    return_pause: float = Field(
        2.0, ge=-1.0, le=86400.0, description="above home before landing; negative: it stays there (s)"
    )

    guided_timeout: Seconds = Field(3.0, description="ArduPilot's GUID_TIMEOUT")
    offboard_timeout: Seconds = Field(1.0, description="PX4's COM_OF_LOSS_T")
    offboard_loss: Literal["hold", "land", "return", "descend"] = Field(
        "hold",
        description="PX4's COM_OBL_RC_ACT: hold 5; land 4; return 3; descend 0, its default, which without RC"
        " sinks",
    )
    failures: Literal["refused", "obeyed"] = Field(
        "refused", description="MAV_CMD_INJECT_FAILURE; PX4's SYS_FAILURE_EN"
    )
    signing_setup: Literal["refused", "obeyed"] = Field(
        "refused",
        description="SETUP_SIGNING, which brings a key in clear: only where no link leaves this machine",
    )
    thrusting: Seconds = Field(
        1.0,
        description="a set-point's acceleration is extrapolated this long, its velocity until the time-out",
    )

    @model_validator(mode="before")
    @classmethod
    def _as_the_firmware(cls, data: Any) -> Any:
        """Set ArduPilot's default speed if none is given: WPNAV_SPEED and MPC_XY_CRUISE differ."""
        if isinstance(data, dict) and data.get("flavour", "ardupilot") == "ardupilot":
            return {"waypoint_speed": 10.0, **data}
        return data
