"""A scenario file: who flies, from where to where, around what, over which links. Typed, checked, frozen."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from companion.config import CompanionConfig

Coordinate = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]
Position = tuple[Coordinate, Coordinate, Coordinate]
Length = Annotated[float, Field(gt=0.0, le=1000.0)]
Milliseconds = Annotated[float, Field(ge=0.0, le=10_000.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Period = Annotated[int, Field(gt=0, le=1_000_000, multiple_of=4)]

FIRST_SYSTEM = 11
"""System id of the first vehicle of a fleet; a recorded target keeps its own."""
TARGET_SYSTEM = 10
"""System id of a target that is not recorded: below the fleet, so that no vehicle can have it."""


class Part(BaseModel):
    """Base of all parts: an unknown key is an error, nothing changes after load."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Origin(Part):
    """The fleet origin: where the fleet-local ENU frame has its zero."""

    latitude: float = Field(47.397742, ge=-89.0, le=89.0, description="degrees")
    longitude: float = Field(8.545594, ge=-180.0, le=180.0, description="degrees")
    altitude: float = Field(488.0, ge=-500.0, le=9000.0, description="m above mean sea level")


class Ring(Part):
    """Starts: evenly on a circle, hovering at ``height`` above the ground, jittered within a ball per
    seed."""

    centre: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    radius: Length
    height: float = Field(
        5.0, ge=0.5, le=100.0, description="m above ground, where the vehicles hover at first"
    )
    jitter: float = Field(0.0, ge=0.0, le=2.0, description="m, radius of the ball around each start")
    first_deg: float = Field(0.0, ge=-360.0, le=360.0, description="bearing of the first vehicle, ENU")


class FixedTarget(Part):
    """A target that stays; with ``jump_to`` it is suddenly elsewhere at the goal event."""

    kind: Literal["fixed"]
    at: Position
    jump_to: Position | None = None
    rate_hz: float = Field(5.0, gt=0.0, le=50.0)


class RecordedTarget(Part):
    """A target that really flew: GLOBAL_POSITION_INT frames of a tlog, unchanged, at their recorded times."""

    kind: Literal["recorded"]
    log: str = Field(description="tlog, relative to config/logs")
    system: int = Field(ge=1, le=255)
    start_s: float = Field(ge=0.0, description="after the log's first record")
    duration_s: float = Field(gt=0.0, le=3600.0)


class Links(Part):
    """Faults of one kind of link."""

    delay_ms: Milliseconds = 20.0
    jitter_ms: Milliseconds = 0.0
    loss: Share = 0.0
    duplication: Share = 0.0
    reordering: Share = 0.0


class AllLinks(Part):
    """The four links of a companion."""

    autopilot: Links = Links(delay_ms=5.0)
    swarm: Links = Links()
    target: Links = Links()
    ground: Links = Links()


class Timing(Part):
    """Periods, µs; all are whole numbers of the base tick."""

    base_tick_us: Period = 2_500
    autopilot_us: Period = Field(
        5_000, description="how often an autopilot's node runs; its physics has its own"
    )
    companion_us: Period = Field(10_000, description="how often a companion's node runs")


class Scenario(Part):
    """One flight."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    description: str = ""
    task: Literal["escort", "antipodal"]
    vehicles: int = Field(ge=1, le=244)
    vehicle: str = Field("firefly", description="file in config/vehicles")
    flavour: Literal["ardupilot", "px4"] = "ardupilot"
    origin: Origin = Origin()
    starts: Ring
    target: Annotated[FixedTarget | RecordedTarget, Field(discriminator="kind")]
    sensors: Literal["truth"] = "truth"
    d_min: Length = Field(0.5, description="m between centres of vehicles; below it is a violation")
    d_min_target: Length | None = Field(None, description="m to the target; null: the target is no obstacle")
    cap_s: float = Field(60.0, gt=0.0, le=3600.0, description="simulated seconds after the goal event")
    links: AllLinks = AllLinks()
    timing: Timing = Timing()
    companion: CompanionConfig = CompanionConfig()

    @property
    def has_goal(self) -> bool:
        """Whether there is a goal event, and so a time of convergence."""
        return self.task == "antipodal" or (
            isinstance(self.target, FixedTarget) and self.target.jump_to is not None
        )

    @property
    def duration_s(self) -> float:
        """How long it is flown at most after the goal event (or after the start of a record)."""
        return self.target.duration_s if isinstance(self.target, RecordedTarget) else self.cap_s

    @model_validator(mode="after")
    def _consistent(self) -> Scenario:
        timing, rates = self.timing, self.companion.rates
        tick = timing.base_tick_us
        if 1_000_000 % tick:
            raise ValueError(f"timing.base_tick_us = {tick} does not divide a second")
        periods = {
            "timing.autopilot_us": timing.autopilot_us,
            "timing.companion_us": timing.companion_us,
            "companion.rates.replan_us": rates.replan_us,
            "companion.rates.setpoint_us": rates.setpoint_us,
        }
        for name, period in periods.items():
            if period % tick:
                raise ValueError(f"{name} = {period} is not a whole number of base ticks of {tick} µs")
        if min(rates.replan_us, rates.setpoint_us) < timing.companion_us:
            raise ValueError(
                f"companion.rates.replan_us and setpoint_us must be at least timing.companion_us = "
                f"{timing.companion_us}"
            )
        if isinstance(self.target, RecordedTarget) and 0 <= self.target.system - FIRST_SYSTEM < self.vehicles:
            raise ValueError(f"target.system = {self.target.system} is the id of a vehicle of the fleet")
        if self.task == "antipodal" and not isinstance(self.target, FixedTarget):
            raise ValueError("task 'antipodal' needs a target of kind 'fixed': what the vehicles face")
        return self
