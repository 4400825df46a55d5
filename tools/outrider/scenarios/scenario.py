"""Scenario file: vehicles, starts and goals, obstacles, links and faults; typed, checked, frozen."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from companion.config.companion import CompanionConfig, Moving, Obstacle
from companion.config.obstacles import MOST_OBSTACLES
from outrider.scenarios.cameras import CameraConfig, VehicleCamera, camera_faults
from outrider.scenarios.faults import Clocks, FaultPart
from outrider.scenarios.links import ROLES, AllLinks, PartitionPart
from outrider.scenarios.moving import MovingPart, clashes
from outrider.scenarios.overlaps import overlaps
from outrider.scenarios.part import FIRST_MOVING, FIRST_SYSTEM, TARGET_SYSTEM, Length, Part, Period
from outrider.scenarios.places import (
    Bystander,
    FixedTarget,
    Origin,
    PathTarget,
    Points,
    RecordedTarget,
    Ring,
    Starts,
    Target,
)
from outrider.scenarios.world_file import WORLD, WorldName, with_world
from sitl.config.gains import ResponseName
from sitl.environment.weather import WeatherConfig

FlavourName = Literal["ardupilot", "px4"]

__all__ = [
    "FIRST_SYSTEM",
    "TARGET_SYSTEM",
    "FixedTarget",
    "Origin",
    "PathTarget",
    "Points",
    "RecordedTarget",
    "Ring",
    "Scenario",
]


_MAX_VEHICLES = 244
"""System ids from 11 to 254; 255 is the operator's."""


class Timing(Part):
    """Periods, µs; all are whole multiples of the base tick."""

    base_tick_us: Period = Field(
        2_500, description="µs: all periods are multiples of it; it divides a second"
    )
    autopilot_us: Period = Field(
        10_000, description="how often an autopilot's node runs; its physics has its own"
    )
    companion_us: Period = Field(10_000, description="how often a companion's node runs")


class AutopilotPart(Part):
    """Response of the autopilots to set-points, and how long a set-point is valid.

    After that ArduPilot brakes, and PX4 leaves offboard mode.
    """

    response: ResponseName = Field(
        "exact",
        description="exact: a vehicle is where its set-points say; firmware: the firmware's position"
        " controller, with stock parameters, on the airframe of its own simulator",
    )
    max_speed: float = Field(
        10.0, gt=0.0, le=200.0, description="m/s, norm, of every reference of the autopilot"
    )
    max_acceleration: float = Field(
        8.0, gt=0.0, le=200.0, description="m/s², norm, of every reference of the autopilot"
    )
    guided_timeout: float = Field(3.0, ge=0.1, le=60.0, description="s, ArduPilot's GUID_TIMEOUT")
    offboard_timeout: float = Field(1.0, ge=0.1, le=60.0, description="s, PX4's COM_OF_LOSS_T")


class Scenario(Part):
    """One flight."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", description="names the run directory")
    description: str = Field("", description="one line for lists and reports")
    task: Literal["escort", "antipodal", "goto"] = Field(
        description="escort: around the target; antipodal: to the opposite place; goto: to starts.goals"
    )
    vehicles: int = Field(ge=1, le=244, description="number with the task, without bystanders")
    vehicle: str = Field("firefly", description="file in config/vehicles")
    flavour: FlavourName | tuple[FlavourName, ...] = Field(
        "ardupilot", description="firmware of all vehicles, or a list that is assigned to them in turn"
    )
    autopilot: AutopilotPart = AutopilotPart()
    origin: Origin = Origin()
    starts: Starts = Field(description="where the vehicles hover first: on a ring, or at given points")
    bystanders: tuple[Bystander, ...] = Field((), max_length=50)
    physics: Literal["own", "jsbsim"] = Field(
        "own", description="what moves the vehicles: our own integrator, or JSBSim (extra sitl)"
    )
    airborne: bool = Field(
        False, description="begin in the air, hovering at the starts, and end there: no take-off, no landing"
    )
    ending: Literal["land", "return"] = Field(
        "land", description="what the operator orders in the end: land here, or return to the start and land"
    )
    target: Target = Field(description="what is escorted or faced: fixed, on a path, or recorded")
    obstacles: tuple[Obstacle, ...] = Field(
        (), max_length=MOST_OBSTACLES, description="fixed, known to all companions"
    )
    world: WorldName | None = Field(None, description=WORLD)
    moving: tuple[MovingPart, ...] = Field(
        (), max_length=50, description="obstacles that move; their system ids are 190 and so on"
    )
    sensors: Literal["truth", "rtk", "gnss", "sih"] = Field(
        "truth",
        description="error of positions: truth, rtk (2 cm), gnss (0.4 m), sih: as PX4's own simulation",
    )
    camera: CameraConfig | None = Field(
        None, description="of every vehicle but the bystanders; null: that of the vehicle's file, if any"
    )
    cameras: tuple[VehicleCamera, ...] = Field(
        (), max_length=244, description="other cameras of single vehicles"
    )
    weather: WeatherConfig = WeatherConfig()
    d_min: Length = Field(
        0.5,
        description="m between centres of vehicles; below it is a violation. It only judges the flight: the"
        " planners keep companion.field.d_min, which must be as large",
    )
    d_min_target: Length | None = Field(None, description="m to the target; null: the target is no obstacle")
    d_min_obstacle: Length = Field(0.5, description="m from a vehicle's centre to an obstacle's surface")
    cap_s: float = Field(60.0, gt=0.0, le=3600.0, description="simulated seconds after the goal event")
    arrival: Literal["all", "others"] = Field(
        "all",
        description="whose arrival ends a flight with a goal 6 s later: that of all vehicles, or of those"
        " whose companion does not end for good, counted from the last such end at the earliest",
    )
    links: AllLinks = AllLinks()
    partitions: tuple[PartitionPart, ...] = ()
    faults: tuple[FaultPart, ...] = Field((), description="what goes wrong with single vehicles, and when")
    clocks: Clocks = Clocks()
    timing: Timing = Timing()
    companion: CompanionConfig = CompanionConfig()

    def with_files(self, folder: Path) -> Self:
        """Return the scenario with the boxes of the file ``world`` in ``folder`` among its obstacles.

        Raises InputError with the faults of that file.
        """
        found = with_world(self.obstacles, self.world, folder)
        return self if self.world is None else self.model_copy(update={"obstacles": found, "world": None})

    @property
    def has_goal(self) -> bool:
        """Whether there is a goal event, and therefore a time of convergence."""
        return self.task in ("antipodal", "goto") or (
            isinstance(self.target, FixedTarget)
            and (self.target.jump_to is not None or bool(self.target.jumps))
        )

    def flavour_of(self, k: int) -> FlavourName:
        """Return the firmware of vehicle ``k`` (0…)."""
        return self.flavour if isinstance(self.flavour, str) else self.flavour[k % len(self.flavour)]

    @property
    def duration_s(self) -> float:
        """Longest time of flight after the goal event (or after the start of a record), s."""
        return self.target.duration_s if isinstance(self.target, RecordedTarget) else self.cap_s

    @property
    def systems(self) -> range:
        """System ids of the fleet: the vehicles with the task, then the bystanders."""
        return range(FIRST_SYSTEM, FIRST_SYSTEM + self.size)

    @property
    def size(self) -> int:
        """Number of all vehicles."""
        return self.vehicles + len(self.bystanders)

    @property
    def moving_systems(self) -> range:
        """System ids of the moving obstacles."""
        return range(FIRST_MOVING, FIRST_MOVING + len(self.moving))

    @property
    def moving_known(self) -> tuple[Moving, ...]:
        """The moving obstacles as companions are configured with them."""
        return tuple(
            one.known_as(system) for one, system in zip(self.moving, self.moving_systems, strict=True)
        )

    @model_validator(mode="after")
    def _consistent(self) -> Scenario:
        found = (
            *self._timing_faults(),
            *self._place_faults(),
            *self._weather_faults(),
            *self._name_faults(),
        )
        for fault in (*found, *overlaps(self.faults, self.partitions)):
            raise ValueError(fault)
        return self

    def _timing_faults(self) -> Iterator[str]:
        timing, rates = self.timing, self.companion.rates
        tick = timing.base_tick_us
        if 1_000_000 % tick:
            yield f"timing.base_tick_us = {tick} does not divide a second"
        periods = {
            "timing.autopilot_us": timing.autopilot_us,
            "timing.companion_us": timing.companion_us,
            "companion.rates.replan_us": rates.replan_us,
            "companion.rates.setpoint_us": rates.setpoint_us,
        }
        for name, period in periods.items():
            if period % tick:
                yield f"{name} = {period} is not a whole number of base ticks of {tick} µs"
        if min(rates.replan_us, rates.setpoint_us) < timing.companion_us:
            yield (
                f"companion.rates.replan_us and setpoint_us must be at least timing.companion_us = "
                f"{timing.companion_us}"
            )

    def _place_faults(self) -> Iterator[str]:
        if not self.flavour:
            yield "flavour is an empty list; allowed: ardupilot, px4, or a list of them"
        if self.size > _MAX_VEHICLES:
            yield f"vehicles and bystanders are {self.size}; at most {_MAX_VEHICLES} are allowed"
        if self.task == "antipodal" and not isinstance(self.starts, Ring):
            yield "task 'antipodal' needs starts of kind 'ring'"
        if isinstance(self.starts, Points) and self.vehicles != len(self.starts.at):
            places = len(self.starts.at)
            yield f"vehicles = {self.vehicles}, but starts.at has {places} places; one each is allowed"
        if (self.task == "goto") != (isinstance(self.starts, Points) and self.starts.goals is not None):
            yield "task 'goto' and starts.goals come together"
        if self.task in ("antipodal", "goto"):
            if not isinstance(self.target, FixedTarget):
                yield f"task {self.task!r} needs a target of kind 'fixed': what the vehicles face"
            if self.companion.task != "goto":
                yield f"task {self.task!r} needs companion.task: goto; it is {self.companion.task!r}"
        elif self.companion.task != "escort":
            yield f"task 'escort' needs companion.task: escort; it is {self.companion.task!r}"

    def _weather_faults(self) -> Iterator[str]:
        if self.physics == "own" and (setting := self.weather.needs_jsbsim):
            yield f"weather.{setting} needs physics: jsbsim; it is 'own'"

    def _name_faults(self) -> Iterator[str]:
        allowed = f"{self.systems[0]} to {self.systems[-1]}"
        if isinstance(self.target, RecordedTarget) and self.target.system in self.systems:
            yield f"target.system = {self.target.system} is the id of a vehicle of the fleet"
        target = self.target.system if isinstance(self.target, RecordedTarget) else TARGET_SYSTEM
        yield from camera_faults(self.cameras, self.systems)
        yield from clashes(self.moving_known, self.systems, target, self.companion.moving)
        for index, fault in enumerate(self.faults):
            if fault.vehicle not in self.systems:
                yield f"faults[{index}].vehicle = {fault.vehicle} is none of the fleet: {allowed} are allowed"
        for index, cut in enumerate(self.partitions):
            for member in cut.members:
                if member not in self.systems:
                    yield f"partitions[{index}].members: {member} is none of the fleet: {allowed} are allowed"
        ends = (None, *ROLES, *self.systems, *self.moving_systems)
        for name in AllLinks.model_fields:
            for index, direction in enumerate(getattr(self.links, name).directions):
                for end in (direction.sender, direction.receiver):
                    if end not in ends:
                        yield (
                            f"links.{name}.directions[{index}]: {end!r} is neither a vehicle ({allowed}) "
                            f"nor one of {', '.join(ROLES)}"
                        )
