"""Air around a vehicle: a mean wind, single gusts, turbulence.

All values are velocities of the air: they point where the wind blows to. The configuration uses fleet-local
ENU, as scenarios do; the result is in site NED, as the physics requires.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from mavlink_bridge.messages import Vector
from sitl.environment.turbulence import W20, Severity, Turbulence
from sitl.values.setpoints import ZERO

_STREAM: Final = 0x57

Speed = Annotated[float, Field(ge=-50.0, le=50.0)]
EnuVelocity = tuple[Speed, Speed, Speed]


class Gust(BaseModel):
    """One gust: 1 − cosine up, and down again, as a pair of the discrete gusts of MIL-F-8785C (3.7.1.3)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    at_s: float = Field(ge=0.0, le=86_400.0, description="begins so long after the goal event (s)")
    length_s: float = Field(gt=0.0, le=600.0, description="is over so long after that (s)")
    velocity: EnuVelocity = Field(description="at its peak, in the middle, on top of the wind (m/s, ENU)")

    def share(self, time: float) -> float:
        """Return the fraction (0…1) of its peak velocity, ``time`` seconds after the goal event."""
        since = time - self.at_s
        if not 0.0 < since < self.length_s:
            return 0.0
        return 0.5 - 0.5 * math.cos(math.tau * since / self.length_s)


class WeatherConfig(BaseModel):
    """Wind, gusts, turbulence and density of the air; by default the air is still."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    wind: EnuVelocity = Field(
        ZERO, description="mean velocity of the air (m/s, ENU: where it goes), at all heights, from the start"
    )
    gusts: tuple[Gust, ...] = Field((), description="single gusts; they add up")
    turbulence: Severity | Annotated[float, Field(ge=0.0, le=50.0)] = Field(
        "none", description="Dryden, of MIL-F-8785C: a severity, or the wind at 20 feet behind it (m/s)"
    )

    turbulence_by: Literal["own", "jsbsim"] = Field(
        "own",
        description="who makes the turbulence: our filters, or JSBSim's, which needs physics: jsbsim, takes "
        "heights above the sea, and is none for a vehicle at rest in still air",
    )
    atmosphere: Literal["uniform", "isa"] = Field(
        "uniform",
        description="density of the air: what the vehicle's numbers were found in, everywhere, or that of "
        "the standard atmosphere (ISA), where they are those at sea level; isa needs physics: jsbsim",
    )

    @property
    def needs_jsbsim(self) -> str:
        """First setting that only JSBSim supports; empty if there is none."""
        if self.turbulence_by == "jsbsim":
            return "turbulence_by: jsbsim"
        return "atmosphere: isa" if self.atmosphere == "isa" else ""

    @property
    def w20(self) -> float:
        """Wind at 20 feet (m/s) that causes the turbulence; 0 for none."""
        return W20[self.turbulence] if isinstance(self.turbulence, str) else self.turbulence

    @property
    def still(self) -> bool:
        """Whether the air never moves."""
        return self.wind == ZERO and self.w20 == 0.0 and all(gust.velocity == ZERO for gust in self.gusts)


class Weather:
    """Air around one vehicle, without the turbulence of JSBSim.

    ``still``: there is never any wind; ``turbulent``: the wind depends on the vehicle's height and velocity.
    """

    def __init__(self, config: WeatherConfig, seed: int, system_id: int) -> None:
        """Start at time 0; ``seed`` (≥ 0) and ``system_id`` seed the turbulence of this vehicle."""
        east, north, up = config.wind
        self._mean = (north, east, -up)
        self._gusts = config.gusts
        self._begun: int | None = None
        level = math.hypot(north, east)
        # Unit vector along the horizontal wind; north without wind.
        self._ahead = (north / level, east / level) if level else (1.0, 0.0)
        self._turbulence = (
            Turbulence(config.w20, np.random.default_rng([seed, system_id, _STREAM]))
            if config.w20 and config.turbulence_by == "own"
            else None
        )
        self.still = config.still
        self.turbulent = self._turbulence is not None

    def begin(self, now: int) -> None:
        """Set the time of the goal event, from which gusts are timed, to ``now`` (µs)."""
        self._begun = now

    def wind(self, now: int, height: float = 0.0, velocity: Vector = ZERO) -> Vector:
        """Return the velocity of the air (m/s, site NED) at ``now`` (µs, not decreasing).

        ``height`` (m above the ground) and ``velocity`` (m/s, site NED) are those of the vehicle; they affect
        only turbulence.
        """
        north, east, down = self._mean
        if self._turbulence is not None:
            u, v, w = velocity
            airspeed = math.hypot(u - north, v - east, w - down)
            self._turbulence.advance(now, height, airspeed)
            along, across, sinking = self._turbulence.components
            c, s = self._ahead
            north, east, down = north + c * along - s * across, east + s * along + c * across, down + sinking
        if self._begun is not None:
            since = (now - self._begun) * 1e-6
            for gust in self._gusts:
                if share := gust.share(since):
                    x, y, z = gust.velocity
                    north, east, down = north + share * y, east + share * x, down - share * z
        return north, east, down
