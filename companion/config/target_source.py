"""Settings: what tells where the target is. One kind counts, so that two that tell of the same target never
pull one track to and fro.

All come by the target link, which may be a log; what the own vehicle's camera tracks comes by the autopilot's
too. All go through the same track, with its gates: ``CompanionConfig.target``.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from companion.values.settings import Settings

_Coordinate = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]


class _Sender(Settings):
    anyone: bool = Field(
        False, description="whoever speaks first is the target, until silent; false: the chosen system alone"
    )


class GlobalPositionSource(_Sender):
    """GLOBAL_POSITION_INT of the target's system."""

    kind: Literal["global_position"] = "global_position"


class FollowTargetSource(_Sender):
    """FOLLOW_TARGET, as phones and ground stations send it; its velocity is used where it has one."""

    kind: Literal["follow_target"]


class CameraSource(Settings):
    """CAMERA_TRACKING_GEO_STATUS of a camera while it tracks."""

    kind: Literal["camera"]
    system: int | None = Field(
        None, ge=1, le=255, description="system id of the camera; null: the own vehicle's"
    )


class FixedSource(Settings):
    """A place that stays where it is; nobody tells."""

    kind: Literal["fixed"]
    at: tuple[_Coordinate, _Coordinate, _Coordinate] = Field(description="m, fleet-local ENU")


TargetSource = Annotated[
    GlobalPositionSource | FollowTargetSource | CameraSource | FixedSource, Field(discriminator="kind")
]


def message_of(source: TargetSource) -> int | None:
    """The id of the message that counts."""
    return {"global_position": 33, "follow_target": 144, "camera": 276}.get(source.kind)


def speaker_of(source: TargetSource, system: int, target: int) -> int | None:
    """The system id that is believed for the companion of ``system`` with a ``target`` of that id; None:
    any."""
    if isinstance(source, CameraSource):
        return system if source.system is None else source.system
    return None if isinstance(source, _Sender) and source.anyone else target
