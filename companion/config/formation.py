"""Settings of how vehicles share a surface around a target."""

from __future__ import annotations

from math import pi
from typing import Annotated, Literal

from pydantic import Field

from companion.values.settings import Positive, Settings

Degrees = Annotated[float, Field(gt=0.0, lt=180.0)]


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


class CameraAccuracy(Settings):
    """Accuracy of one vehicle's camera, as a formation counts on it."""

    vehicle: int = Field(ge=1, le=255, description="system id")
    sigma_range: Positive = Field(description="m, σ along the ray")
    sigma_bearing_deg: Positive = Field(description="degrees, σ across the ray")


class FieldOfView(Settings):
    """Field of view of the vehicles' cameras, for the stand-off."""

    pitch_deg: float | None = Field(
        None,
        gt=-90.0,
        lt=90.0,
        description="degrees, of the optical axis below the horizon in a hover; null: a gimbal turns the"
        " camera towards the target",
    )
    width_deg: Degrees = Field(60.0, description="degrees from the left edge to the right")
    height_deg: Degrees = Field(45.0, description="degrees from the upper edge to the lower")
    sigmas: float = Field(
        2.0, ge=0.0, le=6.0, description="k: the target stays inside by k·σ of its estimated position"
    )
    farthest: float = Field(
        2.0, ge=1.0, le=10.0, description="the stand-off is at most so many times that of the surface"
    )


class Perception(Settings):
    """Formation in which the vehicles turn to the bearings from which all together locate the target best."""

    kind: Literal["perception"]
    sigma_range: Positive = Field(0.75, description="m, σ of a camera along its ray, seen from above")
    sigma_bearing_deg: Positive = Field(1.0, description="degrees, σ of a camera across its ray")
    cameras: tuple[CameraAccuracy, ...] = Field(
        (), max_length=255, description="cameras of another accuracy; what is measured (`fused`) comes before"
    )
    around: float = Field(
        0.3, ge=0.0, le=10.0, description="weight of going all around, among bearings that are equally good"
    )
    apart: float = Field(
        2.5,
        ge=0.0,
        le=100.0,
        description="m along the surface that vehicles keep, where they can without loss",
    )
    gain: Positive = Field(2.0, description="rad of turn of the destination per unit of relative descent")
    speed: Positive = Field(1.5, description="m/s along the surface, at most, to better bearings")
    clear: float = Field(
        0.3, ge=0.0, le=10.0, description="m: an obstacle hides the target from rays that pass it so near"
    )
    hidden_gain: float = Field(
        2.0, ge=0.0, le=20.0, description="turn per rad to the nearest bearing from which nothing hides it"
    )
    view: FieldOfView | None = Field(
        None, description="keeps the target in the field of view; null: does not"
    )
    reach: float = Field(
        8.0,
        ge=1.0,
        le=100.0,
        description="a neighbour takes part that is nearer to the target than so many times the own surface",
    )

    def accuracy(self, system: int) -> tuple[float, float]:
        """Return σ along the ray (m) and across it (degrees) of the camera of the vehicle ``system``."""
        own = next((one for one in self.cameras if one.vehicle == system), self)
        return own.sigma_range, own.sigma_bearing_deg


FormationConfig = Annotated[Nearest | Spread | Perception, Field(discriminator="kind")]
