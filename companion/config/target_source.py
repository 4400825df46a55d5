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

from companion.values.settings import Settings

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


TargetSource = Annotated[
    GlobalPositionSource | FollowTargetSource | CameraSource | FixedSource, Field(discriminator="kind")
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


def sender_of(source: TargetSource, system: int, target: int) -> int | None:
    """Return the system id whose messages count for the companion of ``system``; None for any.

    ``target`` is the system id of its target.
    """
    if isinstance(source, CameraSource):
        return system if source.system is None else source.system
    return None if isinstance(source, _Sender) and source.anyone else target
