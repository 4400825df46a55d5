"""Configuration file of one companion on a vehicle: its vehicle, its fleet's frame, and how it flies."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from companion.config import CompanionConfig
from companion.values.settings import Settings
from mavlink_bridge.frames import FleetFrame
from outrider.scenarios.world_file import WORLD, WorldName, with_world

System = Annotated[int, Field(ge=0, le=250)]
"""System id; 0: not given yet. Ids above 250 are those of ground stations."""


class FleetOrigin(Settings):
    """Origin of the fleet-local frame: the same for all companions, and set only by this configuration."""

    latitude: float = Field(ge=-89.0, le=89.0, description="degrees")
    longitude: float = Field(ge=-180.0, le=180.0, description="degrees")
    altitude: float = Field(ge=-500.0, le=9000.0, description="m above mean sea level, of the ground there")

    @property
    def frame(self) -> FleetFrame:
        """The ENU frame at this origin."""
        return FleetFrame(self.latitude, self.longitude, self.altitude)


class Radio(Settings):
    """Rates that fit a radio as swarm link: periods, and how long a plan is used, µs."""

    state_us: int
    plan_us: int
    plan_stale_us: int
    detection_us: int


RADIOS = {57600: Radio(state_us=400_000, plan_us=540_000, plan_stale_us=1_200_000, detection_us=3_000_000)}
"""Rates by the baud of a radio that eight vehicles and their target share, signed or not (``link_budget``).

A receiver that misses one plan continues with the previous plan, which is 1.6 s long.
"""


class ClockError(Settings):
    """Error that is added to the companion's clock: an aid for tests of fleet time, in simulations only."""

    offset_ms: float = Field(0.0, ge=-600_000.0, le=600_000.0, description="ms that it is ahead at the start")
    drift_ppm: float = Field(0.0, ge=-1000.0, le=1000.0, description="rate at which it runs fast, ppm")


class FlyConfig(Settings):
    """Configuration of one companion; ``system`` is the id of its vehicle."""

    system: System = Field(
        0, description="system id of the own autopilot, no other vehicle's; 0: given by --system"
    )
    target: int = Field(ge=1, le=255, description="system id of the target")
    origin: FleetOrigin
    fleet: str | None = Field(
        None,
        max_length=4096,
        description="fleet file that outrider preflight wrote, relative to this file; settings that this file"
        " states must be the same there",
    )
    takeoff_height: float = Field(5.0, ge=0.5, le=120.0, description="m above the ground, at the go")
    radio: Literal[57600] | None = Field(
        None, description="baud of a radio that eight vehicles share as the swarm link; null: a network"
    )
    clock: Literal["auto", "autopilot", "wall"] = Field(
        "auto",
        description="clock of the companion: autopilot for a simulation, which may run ten times as fast; "
        "wall for a real vehicle; auto: detected before the go from the rate of the autopilot's time",
    )
    period_us: int = Field(
        10_000,
        ge=1_000,
        le=100_000,
        multiple_of=4,
        description="between the companion's steps, µs of that clock",
    )
    clock_error: ClockError | None = Field(
        None, description="for tests in simulations only: an error of the companion's clock; null: none"
    )
    world: WorldName | None = Field(None, description=WORLD.replace("obstacles", "companion.obstacles"))
    companion: CompanionConfig = CompanionConfig()

    def with_files(self, folder: Path) -> Self:
        """Return the configuration with the boxes of the file ``world`` in ``folder`` as obstacles.

        Raises InputError with the faults of that file.
        """
        if self.world is None:
            return self
        found = with_world(self.companion.obstacles, self.world, folder)
        companion = self.companion.model_copy(update={"obstacles": found})
        return self.model_copy(update={"companion": companion, "world": None})

    @property
    def certified(self) -> bool:
        """Whether the vehicle flies committed plans."""
        return self.companion.avoidance == "certified"

    @property
    def settings(self) -> CompanionConfig:
        """The companion's settings, with the rates of the radio."""
        if self.radio is None:
            return self.companion
        radio, companion = RADIOS[self.radio], self.companion
        rates = companion.rates.model_copy(
            update={
                "state_us": radio.state_us,
                "plan_us": radio.plan_us,
                "detection_us": max(radio.detection_us, companion.rates.detection_us),
            }
        )
        guard = companion.guard.model_copy(update={"plan_stale_us": radio.plan_stale_us})
        return companion.model_copy(update={"rates": rates, "guard": guard})

    @model_validator(mode="after")
    def _possible(self) -> FlyConfig:
        if self.target == self.system:
            raise ValueError(f"target: {self.target} is the own system id; allowed: another's")
        if self.companion.avoidance == "certified":
            self._certifiable()
        if self.period_us > self.companion.rates.setpoint_us:
            longest = self.companion.rates.setpoint_us
            raise ValueError(f"period_us must not exceed companion.rates.setpoint_us = {longest}")
        return self

    def _certifiable(self) -> None:
        """Raise ValueError if committed plans cannot be flown with these settings."""
        if self.clock != "wall":
            raise ValueError(
                f"clock {self.clock!r} follows the autopilot's, and committed plans need a clock that runs "
                "evenly; allowed with companion.avoidance 'certified': 'wall'"
            )
        if self.radio is not None:
            raise ValueError(
                f"radio {self.radio}: committed plans do not fit it; "
                "allowed with companion.avoidance 'certified': null"
            )
        if self.companion.certified.range is not None:
            raise ValueError(
                f"companion.certified.range is {self.companion.certified.range:g}: how far the radios of "
                "real vehicles reach is not checked, and it was flown in simulation alone; allowed: null"
            )
        if not self.companion.certified.fleet:
            raise ValueError(
                "companion.certified.fleet is empty: a vehicle that is not heard would not be waited for; "
                "needed: the system ids of all vehicles that fly committed plans"
            )
