"""How near the response of our emulated autopilot comes to a real firmware's, and its two fitted numbers.

    .venv/bin/python tools/benchmarks/response.py [--logs tests/data/flights]

Drag and lag of `sitl.response` are fitted on the figure-eight of one log, or on its first half: least squares
of how far the response alone leads from where the vehicle was. It is then measured where nothing was fitted.
The other gains are the firmware's and stay. At last the whole autopilot flies every log, with the numbers
that it has and without.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.figure_eight import (
    FIRST,
    FITS,
    FULL,
    PVY,
    SECOND,
    Part,
    Percentiles,
    distances,
    during,
    settings,
    trajectory,
    turns,
)
from benchmarks.recorded_flights import Array, RecordedFlight, fly, read_flight
from mavlink_bridge.errors import LogError
from mavlink_bridge.messages import SetpointLocal
from outrider.errors import OutriderError
from outrider.resources import find
from outrider.yaml_file import load
from sitl.config import VehicleConfig
from sitl.response import RESPONSES, Response, Stage
from sitl.setpoints import IGNORE_ACCELERATION, POSITION, ZERO, Setpoint

LOGS: Final = Path(__file__).parents[2] / "tests" / "data" / "flights"
STEP: Final = 0.01
"""s, of the response: as often as the autopilot renews what it tracks."""
WIDTH: Final = 110
"""Of tables that go into a file."""
_BEGIN: Final = (0.5, 0.2)
_FIRST_STRIDE, _LAST_STRIDE = 0.1, 0.0005
"""Where the search for drag (1/s) and lag (s) begins, and by how much it goes on."""
_WAYS: Final = [(up, later) for up in (-1.0, 0.0, 1.0) for later in (-1.0, 0.0, 1.0) if up or later]

Stages = tuple[Stage, ...]


def led(flight: RecordedFlight, stages: Stages, end: float) -> Array:
    """Where the response alone leads along the figure-eight until ``end`` (s): (n, 4), s and m, NED. It
    begins where the vehicle was, at rest."""
    waiting = [(time, _setpoint(message)) for time, message in reversed(trajectory(flight))]
    begin, setpoint = waiting.pop()
    since = begin
    response = Response(stages)
    north, east, down = flight.told.position(np.array([begin]))[0].tolist()
    response.restart((north, east, down))
    path = []
    for now in np.arange(begin, end + STEP, STEP).tolist():
        path.append((now, *response.motion[0]))
        while waiting and waiting[-1][0] <= now:
            since, setpoint = waiting.pop()
        wanted = setpoint.after(now + STEP - since, math.inf)
        response.advance((wanted.position, wanted.velocity, wanted.acceleration), STEP)
    return np.array(path)


def off(flight: RecordedFlight, part: Part, stages: Stages) -> Array:
    """How far (n,), m, the response alone leads from where the vehicle was."""
    end = float(during(flight, part, flight.told.track)[-1, 0])
    return distances(flight, part, led(flight, stages, end))


def fit(flight: RecordedFlight, part: Part, stages: Stages) -> Stages:
    """The stages with those drag and lag of the last one that lead nearest: steps to all sides, ever shorter.
    What they have does not count."""
    console = Console(stderr=True)
    stages = (*stages[:-1], stages[-1]._replace(drag=_BEGIN[0], lag=_BEGIN[1]))
    best, least = stages, _square(off(flight, part, stages))
    stride = _FIRST_STRIDE
    with console.status("") as status:
        while stride > _LAST_STRIDE:
            last = best[-1]
            status.update(f"{part}: drag {last.drag:.3f} 1/s, lag {last.lag:.3f} s, rms {least**0.5:.3f} m")
            tried = [
                (*stages[:-1], last._replace(drag=last.drag + stride * up, lag=last.lag + stride * later))
                for up, later in _WAYS
            ]
            errors = [
                _square(off(flight, part, one)) if min(one[-1].drag, one[-1].lag) >= 0.0 else math.inf
                for one in tried
            ]
            nearest = int(np.argmin(errors))
            if errors[nearest] < least:
                best, least = tried[nearest], errors[nearest]
            else:
                stride *= 0.5
    return best


def fits(flights: dict[str, RecordedFlight]) -> Table:
    """Drag and lag, fitted anew, and how they hold."""
    table = Table(title="the response alone: p50, p95 of the distance from the vehicle, m")
    for head in ("fitted on", "drag, 1/s", "lag, s", "there", "held on", "there"):
        table.add_column(head)
    for here, there in FITS:
        flight, other = flights[here.log], flights[there.log]
        stages = fit(flight, here, RESPONSES[flight.flavour])
        inside, outside = (Percentiles.of(off(*where, stages)) for where in ((flight, here), (other, there)))
        last = stages[-1]
        numbers = f"{last.drag:.3f}", f"{last.lag:.3f}"
        table.add_row(str(here), *numbers, _said(inside), str(there), _said(outside))
    return table


def flown(flights: dict[str, RecordedFlight], vehicle: VehicleConfig) -> Table:
    """Every log, with the numbers that the autopilot has and without."""
    table = Table(title="the whole autopilot: p50, p95 of how far it is off")
    for head in ("log", "firmware, m", "exact, m", "yaw, °"):
        table.add_column(head)
    for name, flight in flights.items():
        with Console(stderr=True).status(f"{name}: {flight.told.track[-1, 0]:.0f} s, flown twice"):
            lagging = fly(flight, vehicle, response="firmware", **settings(flight))
            exact = fly(flight, vehicle, response="exact", **settings(flight))
        for part in (part for part in (FULL, PVY, FIRST, SECOND) if part.log == name):
            rows = (distances(flight, part, one.track) for one in (lagging, exact))
            yaw = np.degrees(turns(flight, part, lagging))
            table.add_row(
                str(part), *(_said(Percentiles.of(row)) for row in rows), _said(Percentiles.of(yaw), 1)
            )
    return table


def main() -> int:
    """The command line; the exit status is 2 when a log is not what it should be."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--logs", type=Path, default=LOGS, help="where the three flights lie")
    given = parser.parse_args()
    try:
        names = dict.fromkeys(part.log for part in (FULL, PVY, FIRST))
        flights = {name: read_flight(given.logs / f"{name}.tlog.gz") for name in names}
        vehicle = load(find("vehicles", "firefly"), VehicleConfig)
    except (LogError, OutriderError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    console = Console()
    if not console.is_terminal:
        console.width = WIDTH
    console.print(fits(flights))
    console.print(flown(flights, vehicle))
    return 0


def _setpoint(message: SetpointLocal) -> Setpoint:
    acceleration = ZERO if message.type_mask & IGNORE_ACCELERATION else message.acceleration
    return Setpoint((POSITION, POSITION, POSITION), message.position, message.velocity, acceleration)


def _square(errors: Array) -> float:
    return float(np.mean(errors**2))


def _said(errors: Percentiles, digits: int = 3) -> str:
    return f"{errors.p50:.{digits}f}, {errors.p95:.{digits}f}"


if __name__ == "__main__":
    sys.exit(main())
