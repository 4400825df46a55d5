"""Settings of how vehicles share a surface around a target."""

from __future__ import annotations

from math import pi
from typing import Annotated, Literal

from pydantic import Field

from companion.values.settings import Settings


class Nearest(Settings):
    """Formation in which each vehicle goes to the point of its surface nearest to it."""

    kind: Literal["nearest"] = "nearest"


class Spread(Settings):
    """Formation in which the vehicles spread evenly around the target."""

    kind: Literal["spread"]
    turn: float = Field(
        1.0,
        gt=0.0,
        le=pi,
        description="rad: a destination is turned by so much at most, so that the way there does not lead"
        " across the surface",
    )
    reach: float = Field(
        8.0,
        ge=1.0,
        le=100.0,
        description="a neighbour takes part that is nearer to the target than so many times the own surface",
    )


FormationConfig = Annotated[Nearest | Spread, Field(discriminator="kind")]
