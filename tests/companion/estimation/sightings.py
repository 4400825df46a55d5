"""A companion's world with one neighbour, and what cameras of both say of the target."""

from __future__ import annotations

import numpy as np

from companion.config import CompanionConfig
from companion.world import World
from mavlink_bridge.messages import (
    CameraFovStatus,
    CameraTrackingGeo,
    GlobalPosition,
    GpsGlobalOrigin,
    LocalPosition,
    Source,
)
from tests.companion.estimation.cameras import FLEET, START, message

OWN, NEIGHBOUR, TARGET = 11, 12, 1
CAMERA = np.array([6.0, 0.0, 5.0])
OTHER = np.array([0.0, 6.0, 5.0])
PLACE = np.zeros(3)


def world(**source) -> World:
    config = CompanionConfig.model_validate(
        {"target_source": {"kind": "fused", **source}, "target": {"rewind_us": 2_000_000}}
    )
    found = World(config, OWN, TARGET, FLEET)
    found.receive(
        START,
        "autopilot",
        GpsGlobalOrigin(Source(OWN, 1), FLEET.latitude, FLEET.longitude, FLEET.altitude, 0),
    )
    return found


def heard(of: World, now: int, *, neighbour: bool = True) -> None:
    """Own position, and the neighbour's: 5 ms and 20 ms old when they arrive."""
    north, east, down = CAMERA[1], CAMERA[0], -CAMERA[2]
    stamp = now - START
    of.receive(
        now, "autopilot", LocalPosition(Source(OWN, 1), stamp - 5_000, (north, east, down), (0.0, 0.0, 0.0))
    )
    if neighbour:
        state = GlobalPosition(
            Source(NEIGHBOUR, 191), stamp - 20_000, *FLEET.to_geodetic(OTHER), 5.0, (0.0, 0.0, 0.0), None
        )
        of.receive(now, "swarm", state)


def view(system: int, component: int, stamp: int, place) -> CameraFovStatus:
    return CameraFovStatus(
        Source(system, component), stamp, FLEET.to_geodetic(place), None, (1.0, 0.0, 0.0, 0.0), 1.2, 0.8
    )


def own_detection(stamp: int, place=PLACE) -> tuple[CameraFovStatus, CameraTrackingGeo]:
    return view(OWN, 100, stamp, CAMERA), message(OWN, place, CAMERA)


def forwarded(stamp: int, place=PLACE, system: int = NEIGHBOUR) -> tuple[CameraFovStatus, CameraTrackingGeo]:
    said = message(system, place, OTHER)._replace(source=Source(system, 191))
    return view(system, 191, stamp, OTHER), said


def give(of: World, now: int, link: str, messages) -> None:
    for one in messages:
        of.receive(now, link, one)


def started(**source) -> tuple[World, int]:
    found = world(**source)
    now = START + 1_000_000
    for tick in range(10):
        now = START + 1_000_000 + 100_000 * tick
        heard(found, now)
    return found, now
