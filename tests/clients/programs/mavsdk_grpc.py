"""MAVSDK 3: ``mavsdk_grpc.py FLAVOUR URL GRPC_PORT``. Its ``mavsdk_server`` comes with the wheel and is
started by ``System``."""

from __future__ import annotations

import asyncio
import sys
from importlib.metadata import version

from mavsdk import System, mission, mission_raw, offboard
from mavsdk_flight import PATIENCE, Drone, fly, run
from telling import clock, tell


async def flight() -> None:
    flavour, url, port = sys.argv[1:]
    system = System(port=int(port))
    await system.connect(system_address=url)

    async def connected() -> None:
        async for state in system.core.connection_state():
            if state.is_connected:
                return

    await asyncio.wait_for(connected(), PATIENCE)
    at = clock()
    tell("discovered", client=version("mavsdk"))
    drone = Drone(
        system.action,
        system.info,
        system.mission_raw,
        system.mission,
        system.offboard,
        system.param,
        system.telemetry,
        offboard,
        mission,
        mission_raw.MissionItem,
        lambda name: getattr(system.telemetry, name)(),
    )
    await fly(drone, flavour, at)


if __name__ == "__main__":
    sys.exit(run(flight))
