"""Comparison of the emulated position controllers with recorded flights of the real firmwares.

    .venv/bin/python tools/benchmarks/response.py [--logs tests/data/flights]

First the whole autopilot flies every figure-eight, with `response: firmware` and with `exact`, and receives
the messages that the recorded vehicle received. Then the response alone flies the set-points that each
vehicle of the recorded swarms received from its companion, and is compared with the true motion.

Only the lags of attitude and thrust were fitted, to the swarms (`angle_lag` and `thrust_lag` in
`sitl/autopilot/position_control/airframe.py`). Gains and limits are the firmware's defaults, mass and drag
those of its simulator.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.figure_eight import (
    FIRST,
    FULL,
    PVY,
    SECOND,
    Percentiles,
    distances,
    settings,
    turns,
)
from benchmarks.recorded_flights import RecordedFlight, fly, read_flight
from benchmarks.recorded_swarms import SwarmVehicle, read_swarm
from benchmarks.swarm_responses import Deviations, follow
from mavlink_bridge.errors import LogError
from outrider.errors import OutriderError
from outrider.resources import find
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig

LOGS: Final = Path(__file__).parents[2] / "tests" / "data" / "flights"
PARTS: Final = (FULL, PVY, FIRST, SECOND)
SWARMS: Final = ("arducopter-5", "mixed-3-2")
WIDTH: Final = 110
"""Width of tables that go into a file."""


def flown(flights: dict[str, RecordedFlight], vehicle: VehicleConfig) -> Table:
    """Return the table of every figure-eight, flown by the whole autopilot with both responses."""
    table = Table(title="the whole autopilot on figure-eights: p50, p95 of how far it is off")
    for head in ("log", "firmware, m", "exact, m", "yaw, °"):
        table.add_column(head)
    for name, flight in flights.items():
        tell(f"{name}: {flight.told.track[-1, 0]:.0f} s, flown twice")
        firmware = fly(flight, vehicle, response="firmware", **settings(flight))
        exact = fly(flight, vehicle, response="exact", **settings(flight))
        for part in (part for part in PARTS if part.log == name):
            rows = (distances(flight, part, one.track) for one in (firmware, exact))
            yaw = np.degrees(turns(flight, part, firmware))
            table.add_row(
                str(part), *(_said(Percentiles.of(row)) for row in rows), _said(Percentiles.of(yaw), 1)
            )
    return table


def followed(swarms: dict[str, list[SwarmVehicle]]) -> Table:
    """Return the table of every vehicle of the recorded swarms, flown by the response alone."""
    table = Table(
        title="the response alone on the set-points of recorded swarms: how far it is off the truth, m"
    )
    for head in ("flight", "vehicle", "p50", "p95", "p95 of the worst 10 s", "which begin at, s"):
        table.add_column(head)
    for name, vehicles in swarms.items():
        for vehicle in vehicles:
            tell(f"{name}: {vehicle}")
            found = Deviations.of(follow(vehicle))
            figures = (f"{figure:.3f}" for figure in found[:3])
            table.add_row(name, str(vehicle), *figures, f"{found.since - vehicle.setpoints[0, 0]:.0f}")
    return table


def tell(what: str) -> None:
    """Report the next step on standard error."""
    sys.stderr.write(f"{what}\n")
    sys.stderr.flush()


def main() -> int:
    """Run the command line; return 2 if a recording is invalid."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--logs", type=Path, default=LOGS, help="where the recorded flights lie")
    given = parser.parse_args()
    try:
        names = dict.fromkeys(part.log for part in PARTS)
        flights = {name: read_flight(given.logs / f"{name}.tlog.gz") for name in names}
        swarms = {name: read_swarm(given.logs / f"{name}.npz") for name in SWARMS}
        vehicle = load(find("vehicles", "firefly"), VehicleConfig)
    except (LogError, OutriderError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    console = Console()
    if not console.is_terminal:
        console.width = WIDTH
    console.print(flown(flights, vehicle))
    console.print(followed(swarms))
    return 0


def _said(errors: Percentiles, digits: int = 3) -> str:
    return f"{errors.p50:.{digits}f}, {errors.p95:.{digits}f}"


if __name__ == "__main__":
    sys.exit(main())
