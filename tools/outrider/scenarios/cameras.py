"""Cameras of a scenario's vehicles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from pydantic import Field

from outrider.scenarios.part import Part, System
from sitl.values.camera import CameraConfig

__all__ = ["CameraConfig", "VehicleCamera", "camera_faults"]


class VehicleCamera(Part):
    """Camera of one vehicle, in place of the fleet's."""

    vehicle: System = Field(description="system id")
    camera: CameraConfig | None = Field(None, description="complete settings; null: it has none")


def camera_faults(cameras: Sequence[VehicleCamera], systems: range) -> Iterator[str]:
    """Yield a sentence for each camera of a vehicle that does not exist or has another one already."""
    for index, one in enumerate(cameras):
        if one.vehicle not in systems:
            allowed = f"{systems[0]} to {systems[-1]}"
            yield f"cameras[{index}].vehicle = {one.vehicle} is none of the fleet: {allowed} are allowed"
    for system, count in Counter(one.vehicle for one in cameras).items():
        if count > 1:
            yield f"cameras: vehicle {system} is listed {count} times; once is allowed"
