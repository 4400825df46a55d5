"""A script as DroneKit's users write it: ``dronekit_flight.py ENDPOINT``.

DroneKit 2.9.2 is from before Python 3.10, which took ``MutableMapping`` out of ``collections``: it is put
back.
"""

from __future__ import annotations

import collections
import collections.abc
import sys
import time
from collections.abc import Callable
from typing import Any

from telling import clock, tell

collections.MutableMapping = collections.abc.MutableMapping  # type: ignore[attr-defined]

import dronekit  # noqa: E402

PATIENCE = 40.0
STEP_DEG = 5e-5
"""Degrees of latitude of the way: 5.6 m."""


def wait(what: str, is_it: Callable[[], bool]) -> None:
    """Raises TimeoutError."""
    end = clock() + PATIENCE
    while not is_it():
        if clock() > end:
            raise TimeoutError(what)
        time.sleep(0.05)


def change(vehicle: Any, mode: str) -> None:
    vehicle.mode = dronekit.VehicleMode(mode)
    wait(mode, lambda: vehicle.mode.name == mode)


def fly(vehicle: Any) -> None:
    wait("armable", lambda: vehicle.is_armable)
    tell("connected", mode=vehicle.mode.name, parameters=len(vehicle.parameters))
    commands = vehicle.commands
    commands.download()
    commands.wait_ready(timeout=PATIENCE)
    home = vehicle.home_location
    tell("downloaded", count=len(commands), home=(home.lat, home.lon, home.alt))

    change(vehicle, "GUIDED")
    vehicle.armed = True
    wait("armed", lambda: vehicle.armed)
    vehicle.simple_takeoff(3.0)
    wait("height", lambda: abs(vehicle.location.global_relative_frame.alt - 3.0) < 0.1)
    start = vehicle.location.global_relative_frame
    tell("up", height=start.alt)

    goal = dronekit.LocationGlobalRelative(start.lat + STEP_DEG, start.lon, 4.0)
    vehicle.simple_goto(goal)
    wait("there", lambda: abs(vehicle.location.global_relative_frame.lat - goal.lat) < 2e-6)
    wait("height", lambda: abs(vehicle.location.global_relative_frame.alt - 4.0) < 0.2)
    local = vehicle.location.local_frame
    tell("there", north=local.north, east=local.east, down=local.down)

    change(vehicle, "LAND")
    wait("disarmed", lambda: not vehicle.armed)
    tell("landed", height=vehicle.location.global_relative_frame.alt)


def main() -> int:
    try:
        vehicle = dronekit.connect(sys.argv[1], wait_ready=True, timeout=PATIENCE)
        fly(vehicle)
        vehicle.close()
    except (TimeoutError, dronekit.APIException) as error:
        tell("failed", error=type(error).__name__, text=str(error))
        return 1
    tell("done")
    return 0


if __name__ == "__main__":
    sys.exit(main())
