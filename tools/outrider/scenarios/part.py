"""Base class of all parts of a scenario file, and the types of numbers in them."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Coordinate = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]
Position = tuple[Coordinate, Coordinate, Coordinate]
Length = Annotated[float, Field(gt=0.0, le=1000.0)]
Milliseconds = Annotated[float, Field(ge=0.0, le=10_000.0)]
Seconds = Annotated[float, Field(ge=0.0, le=3600.0)]
Duration = Annotated[float, Field(gt=0.0, le=3600.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Period = Annotated[int, Field(gt=0, le=1_000_000, multiple_of=4)]
System = Annotated[int, Field(ge=1, le=255)]
"""A MAVLink system id."""

FIRST_SYSTEM = 11
"""System id of the first vehicle of a fleet; a recorded target keeps its own."""
TARGET_SYSTEM = 10
"""System id of a target that is not recorded: below those of the fleet, so that no vehicle has it."""

FIRST_MOVING = 190
"""System id of the first moving obstacle."""


class Part(BaseModel):
    """Base class of all parts: an unknown key is an error, and nothing changes after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
