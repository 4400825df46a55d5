"""MAVSDK 4: ``mavsdk_ctypes.py FLAVOUR URL [VEHICLES]``; several vehicles on one port hop, all at once."""

from __future__ import annotations

import asyncio
import sys
from importlib.metadata import version
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.info import InfoAsync
from mavsdk.asyncio.plugins.mission import MissionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins import mission, mission_raw, offboard
from mavsdk_flight import PATIENCE, Drone, fly, hop, run
from telling import clock, tell


def drone_of(system: Any) -> Drone:
    """The plugins of one system."""
    return Drone(
        ActionAsync(system),
        InfoAsync(system),
        MissionAsync(system),
        MissionRawAsync(system),
        OffboardAsync(system),
        ParamAsync(system),
        TelemetryAsync(system),
        mission,
        mission_raw,
        offboard,
        lambda plugin, name: getattr(plugin, f"subscribe_{name}")(),
    )


async def autopilots(mavsdk: Mavsdk, count: int) -> list[Any]:
    """As soon as there are so many. Raises TimeoutError."""
    until = clock() + PATIENCE
    found: list[Any] = []
    while clock() < until:
        found = [system for system in await mavsdk.get_systems() if await system.has_autopilot()]
        if len(found) == count:
            return found
        await asyncio.sleep(0.05)
    raise TimeoutError(f"{len(found)} of {count} autopilots within {PATIENCE:.0f} s")


async def flight() -> None:
    flavour, url, *several = sys.argv[1:]
    station = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(station) as mavsdk:
        await mavsdk.add_any_connection(url)
        systems = await autopilots(mavsdk, int(several[0]) if several else 1)
        at = clock()
        for system in systems:
            tell("discovered", client=version("mavsdk"), system=await system.get_system_id())
        if several:
            await asyncio.gather(*(hop(drone_of(system), flavour, at) for system in systems))
        else:
            await fly(drone_of(systems[0]), flavour, at)


if __name__ == "__main__":
    sys.exit(run(flight))
