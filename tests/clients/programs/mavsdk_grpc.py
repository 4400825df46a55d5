"""MAVSDK 3: ``mavsdk_grpc.py FLAVOUR URL GRPC_PORT [hop]``. Its ``mavsdk_server`` comes with the wheel and is
started by ``System``; it knows one vehicle, the first that it hears."""

from __future__ import annotations

import asyncio
import sys
from importlib.metadata import version

from mavsdk import System, mission, mission_raw, offboard
from mavsdk_flight import PATIENCE, Drone, fly, hop, run, told
from telling import clock, tell


async def flight() -> None:
    flavour, url, port, *short = sys.argv[1:]
    system = System(port=int(port))
    try:
        # Without a vehicle the server answers nobody.
        await asyncio.wait_for(system.connect(system_address=url), PATIENCE)
        await told(system.core.connection_state(), lambda state: state.is_connected, "connection")
        at = clock()
        tell("discovered", client=version("mavsdk"))
        drone = drone_of(system)
        await (hop(drone, flavour, at) if short else fly(drone, flavour, at))
    finally:
        # It does so only when it is collected, which after an error is never: the program would not end.
        system._stop_mavsdk_server()


def drone_of(system: System) -> Drone:
    """Its plugins."""
    return Drone(
        system.action,
        system.info,
        system.mission,
        system.mission_raw,
        system.offboard,
        system.param,
        system.telemetry,
        mission,
        mission_raw,
        offboard,
        lambda plugin, name: getattr(plugin, name)(),
    )


if __name__ == "__main__":
    sys.exit(run(flight))
