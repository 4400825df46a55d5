"""MAVSDK 4: ``mavsdk_ctypes.py FLAVOUR URL``."""

from __future__ import annotations

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
from mavsdk_flight import PATIENCE, Drone, fly, run
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


async def flight() -> None:
    flavour, url = sys.argv[1:]
    station = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(station) as mavsdk:
        await mavsdk.add_any_connection(url)
        system = await mavsdk.first_autopilot(timeout_s=PATIENCE)
        if system is None:
            raise TimeoutError(f"no autopilot on {url} within {PATIENCE:.0f} s")
        at = clock()
        tell("discovered", client=version("mavsdk"), system=await system.get_system_id())
        await fly(drone_of(system), flavour, at)


if __name__ == "__main__":
    sys.exit(run(flight))
