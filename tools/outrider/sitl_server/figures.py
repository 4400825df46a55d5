"""Results of a run of vehicles, as numbers for scripts."""

from __future__ import annotations

import os
from collections.abc import Sequence

from outrider.sitl_server.addresses import Address
from outrider.sitl_server.request import Request
from outrider.sitl_server.shared_page import Pace, SharedPage

Value = bool | int | float | str | None | list["Value"] | dict[str, "Value"]


def ready(asked: Request, places: Sequence[Address]) -> dict[str, Value]:
    """Return endpoints and connection strings of the vehicles, all of which are up."""
    vehicles: list[Value] = [
        {
            "system_id": system,
            "endpoints": [str(endpoint) for endpoint in place.endpoints],
            "pymavlink": place.pymavlink,
            "mavsdk": place.mavsdk,
        }
        for system, place in zip(asked.systems, places, strict=True)
    ]
    return {"ready": True, "flavour": asked.flavour, "speedup": asked.speed, "vehicles": vehicles}


def summary(asked: Request, board: SharedPage, wall: float) -> dict[str, Value]:
    """Return the summary of a run of ``wall`` seconds.

    All worker processes must have been joined, so that their CPU time is included.
    """
    paces, times = board.paces(), os.times()
    vehicles: list[Value] = []
    for index, system in enumerate(asked.systems):
        snapshot = board.snapshot(index)
        vehicles.append({"system_id": system, "received": snapshot.received, "sent": snapshot.sent})
    return {
        "vehicles": vehicles,
        "simulated_s": round(min(pace.simulated for pace in paces), 3),
        "real_time_factor": round(factor(paces), 4),
        "steps": sum(pace.steps for pace in paces),
        "deadline_misses": sum(pace.misses for pace in paces),
        "deadlines_skipped": sum(pace.skipped for pace in paces),
        "lateness_ms": {
            "p99": round(max(pace.late_p99 for pace in paces) / asked.speed, 3),
            "max": round(max(pace.late_max for pace in paces) / asked.speed, 3),
        },
        "overruns": sum(pace.overruns for pace in paces),
        "processes": len(paces) + 1,
        "wall_s": round(wall, 3),
        "cpu_s": round(times.user + times.system + times.children_user + times.children_system, 3),
    }


def factor(paces: Sequence[Pace], since: Sequence[Pace] = ()) -> float:
    """Return simulated over wall time of the slowest process.

    With ``since`` (earlier timings) it is the factor since then, if wall time has passed in every process. In
    all other cases it is the factor of the whole run.
    """
    before = since or [Pace()] * len(paces)
    spans = [
        (pace.simulated - then.simulated, pace.wall - then.wall)
        for pace, then in zip(paces, before, strict=True)
    ]
    if since and not all(wall > 0.0 for _, wall in spans):
        return factor(paces)
    return min((simulated / wall for simulated, wall in spans if wall > 0.0), default=0.0)
