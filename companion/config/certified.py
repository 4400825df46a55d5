"""Settings of the certified mode. SI units, times in µs."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import ConfigDict, Field, model_validator

from companion.values.settings import Positive, Settings, WireStep

Weight = Annotated[float, Field(ge=0.0, le=1e4)]


SystemId = Annotated[int, Field(ge=1, le=255)]


class DeadlockConfig(Settings):
    """Turn of the goal to the side when a plan is pushed back and makes no progress."""

    bend: Positive = Field(0.8, description="rad, the largest turn at first")
    bend_more: Positive = Field(3.1, description="rad, the largest turn ever")
    patience: Positive = Field(2.5, description="s without progress before larger turns are tried")
    slow: Positive = Field(1.0, description="rad/s by which the largest turn grows then")
    detour: Positive = Field(
        3.0, description="m: on a turn that is larger than ``bend`` the goal is no further"
    )
    up: Positive = Field(4.0, description="rad/s at which it turns aside where it is pushed back in full")
    down: Positive = Field(6.0, description="rad/s at which it turns back")
    chase: Positive = Field(
        1.0, description="m/s to the side and ahead with which another vehicle is not turned away from"
    )
    speed: Positive = Field(2.0, description="m/s of the rest point towards the goal that is no stall")
    pushed: float = Field(0.2, ge=0.0, lt=1.0, description="share of the pull from which it counts as pushed")


class AnticipationConfig(Settings):
    """Turn of the goal to the side because of encounters that are predicted."""

    most: float = Field(
        1.2,
        ge=0.0,
        le=1.5,
        description="rad, the largest turn; 0 switches it off; for ``planar`` flights without lanes",
    )
    wide: Positive = Field(
        0.1, description="s: wanted distance beyond the least one of plans, that v_max flies in this time"
    )
    room: float = Field(
        2.0,
        gt=0.0,
        le=5.0,
        description="radius of the circle on which vehicles pass each other, in radii of the smallest one"
        " that has room for them",
    )
    reach: Positive = Field(
        1.4,
        description="s: while somebody is met, the plan aims no further ahead than v_max flies in this time,"
        " or than the vehicle needs to brake from v_max",
    )
    wide_late: float = Field(
        1.7,
        ge=0.0,
        le=100.0,
        description="1/s: share of the least distance of plans that the wanted one grows by for each second"
        " that the plans of agreements are older than two epochs on average, up to twice this age",
    )
    fresh: Positive = Field(
        1.0,
        description="s: with agreements on plans that are older on average, a plan aims as far ahead as if"
        " nobody were met",
    )
    wrong_side: float = Field(
        0.5,
        ge=0.0,
        le=1.0,
        description="wanted distances on the side of the turn beyond which another passes there",
    )


class FollowingConfig(Settings):
    """Cost of a plan whose destination moves; all other weights are those of a destination at rest."""

    speed: Positive = Field(0.05, description="m/s of the destination from which it is followed")
    omega_place: Positive = Field(40.0, description="weight of where the plan is after its first step")
    decay: float = Field(3.0, ge=0.0, le=20.0, description="1/s by which this weight decreases from then on")
    omega_end: Weight = Field(1.0, description="additional weight of where the plan comes to rest")
    omega_speed: Weight = Field(1.0, description="weight of its speeds relative to the destination's")
    omega_jerk: Weight = Field(1.0, description="weight of the change of a from step to step")


class TimeSourcesConfig(Settings):
    """Sources of fleet time, where it is measured."""

    reference: int | None = Field(
        None,
        ge=1,
        le=255,
        description="system id of the vehicle whose companion's clock is fleet time; null: fleet time is UTC",
    )
    system: bool = Field(True, description="the system clock, while its kernel says that it is disciplined")
    autopilot_us: int | None = Field(
        None,
        ge=0,
        le=10_000_000,
        description="largest error of the autopilot's UTC when it was set, µs; null: it is not used, because"
        " neither firmware bounds it",
    )
    autopilot_drift_ppm: int = Field(
        100, ge=0, le=10_000, description="largest drift of the autopilot's UTC from its boot on"
    )
    drift_ppm: int = Field(100, ge=0, le=10_000, description="largest drift of two clocks against each other")
    lateness_us: int = Field(
        1_000,
        ge=0,
        le=1_000_000,
        description="largest time from the start of a step, which dates messages, to their reading",
    )
    wrong: int = Field(
        1, ge=0, le=100, description="number of wrong sources that are tolerated; always a minority"
    )


class FlightSettings(NamedTuple):
    """Settings of ``CertifiedConfig`` whose defaults differ between flights in the plane and in space."""

    omega_input: float
    omega_jerk: float
    plane_shift: float


# In the plane many that brake late stop each other.
_IN_PLANE = FlightSettings(omega_input=0.05, omega_jerk=0.3, plane_shift=0.75)
_IN_SPACE = FlightSettings(omega_input=0.02, omega_jerk=0.2, plane_shift=0.0)


class CertifiedConfig(Settings):
    """Committed plans, planes and epochs."""

    model_config = ConfigDict(
        json_schema_extra={
            "renamed": {
                "helm_us": "backup_hover_us",
                "stall": "deadlock",
                "stranger_speed": "noncooperative_speed",
                "stranger_acceleration": "noncooperative_acceleration",
            }
        }
    )

    dt_us: WireStep = Field(220_000, description="knots of the plans, µs: absolute, k·dt")
    epoch_us: int = Field(220_000, gt=0, le=2_000_000, multiple_of=4, description="µs; a whole number of dt")
    last_call_us: int = Field(
        20_000,
        ge=0,
        le=1_000_000,
        description="µs before the end of an epoch from which the companion waits for no message",
    )
    repeat_us: int = Field(
        50_000, gt=0, le=2_000_000, multiple_of=4, description="µs between two transmissions of a plan"
    )
    repeat_in_loss: float = Field(
        2.5,
        ge=1.0,
        le=5.0,
        description="how many times as often plans are transmitted while four of five transmissions of others"
        " are lost; 1: never more often",
    )
    lead_us: int = Field(
        60_000,
        gt=0,
        le=2_000_000,
        description="µs before the end of an epoch at which the plan of the next one is made",
    )
    gone_us: int = Field(
        1_000_000, gt=0, le=60_000_000, description="µs of silence after which no plan waits for a vehicle"
    )
    tube: Positive = Field(
        0.25, description="m, largest tracking error for which plans keep their separation"
    )
    drift: Positive = Field(
        0.5,
        description="m, largest horizontal distance from its column's axis of a vehicle that its autopilot"
        " takes off or lands; the default is for calm air, wind needs more",
    )
    sigmas: float = Field(3.0, ge=0.0, le=6.0, description="k of k·σ of the position estimate")
    d_min_obstacle: Positive | None = Field(
        None,
        description="m, least distance of a vehicle's centre from the surfaces of fixed obstacles; null:"
        " `field.d_min`, that of two vehicles",
    )
    plane_shift: float | None = Field(
        None,
        ge=0.0,
        le=0.9,
        description="how far agreed planes move with both vehicles: where one flies behind the other, it has"
        " (1 + ``plane_shift``)/2 of the room between them; 0: a half; null: 0.75 in `planar` flights, or 0;"
        " the same for the whole fleet",
    )
    clock_us: int = Field(5_000, ge=0, le=100_000, description="µs that a clock may differ from fleet time")
    fleet_time: Literal["own", "measured"] = Field(
        "own",
        description="own: the companion's clock; measured: from ``time_sources``, and the plan is held while"
        " its error may exceed ``clock_us``",
    )
    time_sources: TimeSourcesConfig = TimeSourcesConfig()
    backup_hover_us: int = Field(
        10_000_000,
        ge=0,
        le=600_000_000,
        description="µs of hover at the end of a plan whose companion is gone",
    )
    fleet: tuple[SystemId, ...] = Field(
        (), max_length=255, description="system ids that take part: no vehicle moves before all are received"
    )
    range: Positive | None = Field(
        None,
        description="m, true horizontal distance up to which two vehicles are certain to hear each other in"
        " ``contact_us``, at any heights; vehicles beyond it need no agreement, and all plans are so short"
        " that vehicles that have not heard each other do not meet; the same for the whole fleet; null: all"
        " agree with all",
    )
    contact_us: int = Field(
        500_000,
        gt=0,
        le=10_000_000,
        description="µs within ``range`` after which each of two vehicles has received the other's plan and"
        " statement",
    )
    noncooperative_speed: Positive = Field(1.0, description="m/s, of those that share no plan")
    noncooperative_acceleration: Positive = Field(1.0, description="m/s², of those that share no plan")
    noncooperative_growth_us: int | None = Field(
        None,
        ge=0,
        le=60_000_000,
        description="µs of a plan in which those that share no plan may deviate from the received velocity;"
        " afterwards they are assumed to have it; null: all of the plan",
    )
    omega_end: Positive = Field(30.0, description="weight of where the plan comes to rest")
    omega_place: Weight = Field(0.3, description="weight of where it is after each step before")
    omega_speed: Weight = Field(0.1, description="weight of its speeds")
    omega_input: Positive | None = Field(
        None, description="weight of a; null: 0.05 in `planar` flights, or 0.02"
    )
    omega_field: Weight = Field(0.3, description="weight of the field of those that share no plan")
    omega_jerk: Weight | None = Field(
        None,
        description="weight of the change of a from step to step; null: 0.3 in `planar` flights, or 0.2",
    )
    spare: Positive = Field(0.01, description="m wanted beyond the least distance, for rounding")
    following: FollowingConfig = FollowingConfig()
    deadlock: DeadlockConfig = DeadlockConfig()
    anticipation: AnticipationConfig = AnticipationConfig()

    @property
    def knots(self) -> int:
        """Number of knots in an epoch."""
        return self.epoch_us // self.dt_us

    def for_flight(self, *, planar: bool) -> FlightSettings:
        """Return the chosen settings; in place of those that are null what suits the plane, or space."""
        defaults = _IN_PLANE if planar else _IN_SPACE
        chosen = {name: getattr(self, name) for name in FlightSettings._fields}
        return defaults._replace(**{name: value for name, value in chosen.items() if value is not None})

    @model_validator(mode="after")
    def _epochs(self) -> CertifiedConfig:
        if self.epoch_us % self.dt_us:
            raise ValueError(f"certified.epoch_us must be a multiple of dt_us = {self.dt_us}")
        if self.last_call_us >= self.epoch_us:
            raise ValueError(f"certified.last_call_us must be less than epoch_us = {self.epoch_us}")
        if self.last_call_us > self.lead_us:
            # Each epoch would be over for messages before its plan is to be made: there would be none.
            raise ValueError(f"certified.last_call_us must be at most lead_us = {self.lead_us}")
        return self
