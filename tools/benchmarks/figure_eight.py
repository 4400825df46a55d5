"""Figure-eight that each recorded vehicle received, in parts, and the distance of another flight from it."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from benchmarks.recorded_flights import Array, RecordedFlight, ReportedData
from mavlink_bridge.messages import SetpointLocal

_TRAJECTORY: Final[int] = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE
)
"""Ignore bits of position and velocity: if none is set, the set-points are a trajectory."""
_AS_RECORDED: Final[dict[str, dict[str, Any]]] = {
    "ardupilot": {"land_speed": 0.5, "takeoff_speed": 2.5},
    "px4": {"land_speed": 0.7, "offboard_loss": "descend"},
}


class Part(NamedTuple):
    """Part of the figure-eight in a log, from one share of its time to another."""

    log: str
    begin: float = 0.0
    end: float = 1.0

    def __str__(self) -> str:
        whole = (self.begin, self.end) == (0.0, 1.0)
        return self.log if whole else f"{self.log}, {self.begin:.0%} to {self.end:.0%}"


FIRST, SECOND = Part("px4-pvay", 0.0, 0.5), Part("px4-pvay", 0.5, 1.0)
FULL, PVY = Part("copter-full"), Part("copter-pvy")
FITS: Final = ((FULL, PVY), (PVY, FULL), (FIRST, SECOND))
"""Pairs of parts: drag and lag are fitted to the first and must hold for the second.

The second pair only shows how little the choice of the log matters.
"""


class Percentiles(NamedTuple):
    """Percentiles of errors."""

    p50: float
    p95: float

    @classmethod
    def of(cls, errors: Array) -> Percentiles:
        """Return the percentiles of errors (n,)."""
        return cls(*np.percentile(errors, (50.0, 95.0)).tolist())


def settings(flight: RecordedFlight) -> dict[str, Any]:
    """Return the firmware's defaults of the recorded vehicle, for ``AutopilotConfig``.

    The vehicle was ready before it received a request, and sent the streams that a ground station expects.
    """
    return {"ready_after": 4.0, "streams": "normal", **_AS_RECORDED[flight.flavour]}


def trajectory(flight: RecordedFlight) -> list[tuple[float, SetpointLocal]]:
    """Return the set-points of the figure-eight with their times (s): all that have position and velocity."""
    return [
        (time, message)
        for time, message in flight.sent
        if isinstance(message, SetpointLocal) and not message.type_mask & _TRAJECTORY
    ]


def during(flight: RecordedFlight, part: Part, rows: Array) -> Array:
    """Return those rows (n, k), with time (s) in the first column, that lie in a part of the figure-eight."""
    sent = trajectory(flight)
    begin, length = sent[0][0], sent[-1][0] - sent[0][0]
    shares = (rows[:, 0] - begin) / length
    return np.asarray(rows[(shares >= part.begin) & (shares <= part.end)])


def distances(flight: RecordedFlight, part: Part, track: Array) -> Array:
    """Return the distances (n,), m, of a track (m, 4), s and m, NED, from the recorded one at its times."""
    there = during(flight, part, flight.told.track)
    here = np.column_stack([np.interp(there[:, 0], track[:, 0], x) for x in track[:, 1:].T])
    return np.asarray(np.linalg.norm(here - there[:, 1:], axis=1))


def turns(flight: RecordedFlight, part: Part, told: ReportedData) -> Array:
    """Return the differences (n,), rad, between the yaw of another flight and the recorded yaw."""
    there = during(flight, part, flight.told.headings)
    here = np.interp(there[:, 0], told.headings[:, 0], np.unwrap(told.headings[:, 1]))
    return np.asarray(np.abs(np.remainder(here - there[:, 1] + np.pi, 2.0 * np.pi) - np.pi))
