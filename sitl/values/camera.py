"""Settings of a simulated camera: optics, mount, timing, errors, and what it says."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from mavlink_bridge.pinhole import Pinhole

_Offset = Annotated[float, Field(ge=-2.0, le=2.0)]
_Tilt = Annotated[float, Field(ge=-90.0, le=90.0)]
_Pixels = Annotated[int, Field(ge=16, le=16384)]
_Share = Annotated[float, Field(ge=0.0, le=1.0)]


class _Settings(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class FixedMount(_Settings):
    """Camera fixed to the body, facing forward."""

    kind: Literal["fixed"]
    pitch_deg: _Tilt = Field(0.0, description="degrees, of the optical axis below the nose")
    at: tuple[_Offset, _Offset, _Offset] = Field(
        (0.1, 0.0, 0.05), description="m, place in body axes: forward, right, down"
    )


class GimbalMount(_Settings):
    """Camera on a gimbal that keeps roll and pitch relative to the horizon and turns with the vehicle."""

    kind: Literal["gimbal"]
    pitch_deg: _Tilt = Field(0.0, description="degrees, of the optical axis below the horizon, at first")
    follows: bool = Field(True, description="whether it turns to the detected target, in pitch")
    lowest_deg: _Tilt = Field(90.0, description="degrees below the horizon, at most")
    highest_deg: _Tilt = Field(-30.0, description="degrees below the horizon, at least; negative is above")
    rate_deg_s: float = Field(90.0, gt=0.0, le=1000.0, description="degrees/s, at most")
    at: tuple[_Offset, _Offset, _Offset] = Field(
        (0.1, 0.0, 0.05), description="m, place in body axes: forward, right, down"
    )

    @model_validator(mode="after")
    def _in_range(self) -> GimbalMount:
        if not self.highest_deg <= self.pitch_deg <= self.lowest_deg:
            raise ValueError(
                f"pitch_deg = {self.pitch_deg}; allowed: highest_deg = {self.highest_deg} to"
                f" lowest_deg = {self.lowest_deg}"
            )
        return self


class TrackedObject(_Settings):
    """Upright object that the camera detects; the place that counts is its foot.

    Its height is known with ``height_sigma``, an error that differs from image to image: a person bends and
    steps. The error of the range is in proportion: range · height_sigma / height.
    """

    height: float = Field(1.8, gt=0.0, le=100.0, description="m")
    height_sigma: float = Field(0.15, ge=0.0, le=100.0, description="m, σ")
    width: float = Field(0.5, gt=0.0, le=100.0, description="m; only of the rectangle in 275")


class CameraConfig(_Settings):
    """One camera, which detects one object in its images and says where it is."""

    resolution: tuple[_Pixels, _Pixels] = Field((1280, 720), description="pixels: columns, rows")
    field_of_view_deg: float = Field(70.0, ge=1.0, le=170.0, description="degrees, horizontal")
    mount: Annotated[FixedMount | GimbalMount, Field(discriminator="kind")] = Field(
        FixedMount(kind="fixed"), description="how it is fixed to the vehicle"
    )
    rate_hz: float = Field(10.0, gt=0.0, le=60.0, description="images per second")
    latency_ms: float = Field(
        100.0, ge=40.0, le=5000.0, description="ms from an image to its message: exposure, detection"
    )
    range: float = Field(50.0, gt=0.0, le=10_000.0, description="m, of the farthest detection")
    least_pixels: float = Field(8.0, ge=1.0, le=10_000.0, description="rows that the object covers, at least")
    pixel_sigma: float = Field(
        2.0, ge=0.0, le=1000.0, description="pixels, σ of upper edge, lower edge and centre column"
    )
    missed: _Share = Field(0.0, description="share of images of a visible object without a detection")
    false_positives: _Share = Field(0.0, description="share of images with a false detection in its place")
    object: TrackedObject = TrackedObject()
    speaks: Literal["geo", "image"] = Field(
        "geo", description="CAMERA_TRACKING_GEO_STATUS (276), or CAMERA_TRACKING_IMAGE_STATUS (275) alone"
    )
    fov_status: bool = Field(
        True, description="whether CAMERA_FOV_STATUS (271) with the time of the image comes before each"
    )
    accuracy: bool = Field(True, description="whether accuracies, distance and heading of 276 are filled in")

    @property
    def pinhole(self) -> Pinhole:
        """Optics."""
        return Pinhole.of_field(*self.resolution, math.radians(self.field_of_view_deg))

    @property
    def period(self) -> int:
        """Time between images (µs)."""
        return round(1e6 / self.rate_hz)

    @property
    def latency(self) -> int:
        """Time from an image to its message (µs)."""
        return round(1e3 * self.latency_ms)
