"""Cameras of a scenario's vehicles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Annotated

from pydantic import Field

from companion.config.companion import Obstacle
from outrider.scenarios.part import Part, System
from outrider.scenarios.places import FixedTarget, PathTarget
from sitl.values.camera import CameraConfig

__all__ = ["CameraConfig", "CameraFile", "VehicleCamera", "camera_faults"]


class VehicleCamera(Part):
    """Camera of one vehicle, in place of the fleet's."""

    vehicle: System = Field(description="system id")
    camera: CameraConfig | None = Field(None, description="complete settings; null: it has none")


class CameraFile(Part):
    """Camera of the vehicles of ``outrider sitl``, and what it may see; positions from their origin."""

    camera: CameraConfig = Field(CameraConfig(), description="of every vehicle")
    target: Annotated[FixedTarget | PathTarget, Field(discriminator="kind")] = Field(
        description="tracked object; it begins to move when the vehicles boot"
    )
    obstacles: tuple[Obstacle, ...] = Field((), max_length=500, description="fixed; they hide it")


def camera_faults(cameras: Sequence[VehicleCamera], systems: range) -> Iterator[str]:
    """Yield a sentence for each camera of a vehicle that does not exist or has another one already."""
    for index, one in enumerate(cameras):
        if one.vehicle not in systems:
            allowed = f"{systems[0]} to {systems[-1]}"
            yield f"cameras[{index}].vehicle = {one.vehicle} is none of the fleet: {allowed} are allowed"
    for system, count in Counter(one.vehicle for one in cameras).items():
        if count > 1:
            yield f"cameras: vehicle {system} is listed {count} times; once is allowed"
