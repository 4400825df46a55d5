"""MAVSDK 3: ``mavsdk_grpc.py FLAVOUR URL GRPC_PORT [hop]``. Its ``mavsdk_server`` comes with the wheel and is
started by ``System``; it knows one vehicle, the first that it hears."""

from __future__ import annotations

import sys
from importlib.metadata import version

from mavsdk import System, mission, mission_raw, offboard
from mavsdk_flight import Drone, fly, hop, run, told
from telling import clock, tell


async def flight() -> None:
    flavour, url, port, *short = sys.argv[1:]
    system = System(port=int(port))
    await system.connect(system_address=url)

    await told(system.core.connection_state(), lambda state: state.is_connected, "connection")
    at = clock()
    tell("discovered", client=version("mavsdk"))
    drone = Drone(
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
    await (hop(drone, at) if short else fly(drone, flavour, at))


if __name__ == "__main__":
    sys.exit(run(flight))
