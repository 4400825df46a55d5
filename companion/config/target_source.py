"""Settings of the source of the target's position.

Only one kind is used, so that two sources do not move one track alternately. Messages of all kinds arrive on
the target link, which may be a log; those of a camera also on the autopilot's link. All are filtered by the
same track, with its gates: ``CompanionConfig.target``.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Literal

from pydantic import Field
from pymavlink.dialects.v20 import all as mavlink

from companion.values.settings import Positive, Settings

_Coordinate = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]


class _Sender(Settings):
    anyone: bool = Field(
        False, description="the first sender is the target until it is silent; false: only the chosen system"
    )


class GlobalPositionSource(_Sender):
    """GLOBAL_POSITION_INT of the target's system."""

    kind: Literal["global_position"] = "global_position"


class FollowTargetSource(_Sender):
    """FOLLOW_TARGET, as sent by phones and ground stations; its velocity is used where it has one."""

    kind: Literal["follow_target"]


class CameraSource(Settings):
    """CAMERA_TRACKING_GEO_STATUS of a camera while it tracks."""

    kind: Literal["camera"]
    system: int | None = Field(
        None, ge=1, le=255, description="system id of the camera; null: the own vehicle's"
    )


class FixedSource(Settings):
    """Fixed position, without messages."""

    kind: Literal["fixed"]
    at: tuple[_Coordinate, _Coordinate, _Coordinate] = Field(description="m, fleet-local ENU")


class OwnErrors(Settings):
    """Errors of a detecting vehicle's own estimate, which all its detections of some time have in common.

    Each is a first-order Gauss–Markov process: σ, and the time constant of its autocorrelation.
    """

    sigma_horizontal: float = Field(0.5, ge=0.0, le=100.0, description="m, of the position, each axis")
    sigma_vertical: float = Field(0.75, ge=0.0, le=100.0, description="m, of the height")
    position_s: float = Field(45.0, gt=0.0, le=3600.0, description="s")
    sigma_yaw_deg: float = Field(1.5, ge=0.0, le=45.0, description="degrees")
    yaw_s: float = Field(120.0, gt=0.0, le=3600.0, description="s")
    sigma_tilt_deg: float = Field(
        0.5, ge=0.0, le=45.0, description="degrees, of the ray's elevation; near 0 with a stabilised gimbal"
    )
    tilt_s: float = Field(20.0, gt=0.0, le=3600.0, description="s")
    sigma_white: float = Field(0.03, ge=0.0, le=10.0, description="m, of each position; not in common")
    age_us: int = Field(
        0,
        ge=0,
        le=500_000,
        description="µs: age of the position that a vehicle states, at the time that it states; corrected by"
        " its velocity",
    )
    sigma_time_us: float = Field(
        3000.0,
        ge=0.0,
        le=500_000.0,
        description="µs, σ of the images' times that all vehicles have in common; the target's speed makes it"
        " an error of its place",
    )
    sigma_image_us: float = Field(
        5000.0,
        ge=0.0,
        le=500_000.0,
        description="µs, σ of the images' times of one vehicle beside that, not in common with the others",
    )


_GNSS_ERRORS = OwnErrors()


class Optics(Settings):
    """Own camera that tells the target's place in its image (275), but not where it looked (271)."""

    width_deg: float = Field(gt=0.0, lt=170.0, description="degrees, horizontal angle of view")
    height_deg: float = Field(gt=0.0, lt=170.0, description="degrees, vertical angle of view")
    pitch_deg: float = Field(
        0.0,
        ge=-90.0,
        le=90.0,
        description="degrees, optical axis below the nose of the vehicle; GIMBAL_DEVICE_ATTITUDE_STATUS"
        " replaces it",
    )


class FusedSource(Settings):
    """Detections of the own camera and of the neighbours', fused."""

    kind: Literal["fused"]
    share: bool = Field(True, description="forward the own detections on the swarm link")
    vehicles: tuple[int, ...] = Field(
        (),
        max_length=64,
        description="system ids whose detections count; empty: all companions whose position is received",
    )
    device: int | None = Field(
        None, ge=0, le=255, description="camera_device_id of detections of the target; null: any"
    )
    latency_us: int = Field(
        100_000,
        ge=0,
        le=5_000_000,
        description="µs: age of a detection whose image's time (CAMERA_FOV_STATUS) is not sent",
    )
    optics: Optics | None = Field(
        None,
        description="of the own camera, if it sends CAMERA_TRACKING_IMAGE_STATUS without CAMERA_FOV_STATUS;"
        " null: such detections are dropped",
    )
    height: float = Field(
        1.8,
        gt=0.0,
        le=100.0,
        description="m, of the target: for cameras that send its place in the image, and for the accuracy of"
        " elevations, which none sends",
    )
    sigma_height: float = Field(0.15, gt=0.0, le=10.0, description="m, σ of that from image to image")
    sigma_row: float = Field(
        0.003, gt=0.0, le=0.1, description="σ of an edge in the image, as a share of the image's height"
    )
    sigma_range_share: float = Field(
        0.1, gt=0.0, le=1.0, description="σ along the ray per distance, where a camera does not say"
    )
    sigma_bearing_deg: float = Field(
        0.3, gt=0.0, le=45.0, description="degrees, σ across the ray, where a camera does not say"
    )
    sigma_acceleration: Positive = Field(
        1.0,
        description="m/s², of the target's horizontal acceleration, each axis; half of it is the least"
        " assumed",
    )
    sigma_climb: Positive = Field(0.2, description="m/s², of its vertical acceleration")
    acceleration_s: float = Field(
        1.0, ge=0.1, le=100.0, description="s, time constant of the acceleration's autocorrelation"
    )
    adapt: float = Field(
        20.0,
        ge=1.0,
        le=1000.0,
        description="factor by which both σ grow at most, if detections show more acceleration; if they show"
        " less, both shrink to half at most; 1: neither",
    )
    adapt_s: float = Field(
        10.0, ge=0.1, le=3600.0, description="s, time constant at which they forget detections"
    )
    own_errors: OwnErrors | None = Field(
        None, description="of every vehicle; null: of the scenario's sensors, otherwise those of GNSS"
    )
    gate: Positive = Field(16.27, description="on d² = yᵀS⁻¹y, χ² of three: 99.9 % of what is true pass")

    @property
    def errors(self) -> OwnErrors:
        """Errors of the vehicles' own estimates."""
        return _GNSS_ERRORS if self.own_errors is None else self.own_errors


TargetSource = Annotated[
    GlobalPositionSource | FollowTargetSource | CameraSource | FixedSource | FusedSource,
    Field(discriminator="kind"),
]


_MESSAGES: Mapping[str, int] = MappingProxyType(
    {
        "global_position": mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        "follow_target": mavlink.MAVLINK_MSG_ID_FOLLOW_TARGET,
        "camera": mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS,
    }
)


def message_of(source: TargetSource) -> int | None:
    """Return the id of the MAVLink message that is used; None for a fixed place."""
    return _MESSAGES.get(source.kind)


DETECTIONS = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_CAMERA_FOV_STATUS,
        mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS,
        mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_IMAGE_STATUS,
    }
)
"""Messages of detections to be fused."""
GIMBAL: int = mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS
"""Message that says where a camera with ``optics`` looks."""


def sender_of(source: TargetSource, system: int, target: int) -> int | None:
    """Return the system id whose messages count for the companion of ``system``; None for any.

    ``target`` is the system id of its target.
    """
    if isinstance(source, CameraSource):
        return system if source.system is None else source.system
    return None if isinstance(source, _Sender) and source.anyone else target
