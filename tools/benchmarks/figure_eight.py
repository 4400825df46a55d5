"""The figure-eight that each recorded vehicle was sent, in parts, and how far another flight is from it."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from benchmarks.recorded_flights import Array, RecordedFlight, Told
from mavlink_bridge.messages import SetpointLocal

_TRAJECTORY: Final = 0x03F
"""Ignore bits of position and velocity: where none is set, set-points are a trajectory."""
_AS_RECORDED: Final[dict[str, dict[str, Any]]] = {
    "ardupilot": {"land_speed": 0.5, "takeoff_speed": 2.5},
    "px4": {"land_speed": 0.7, "offboard_loss": "descend"},
}


class Part(NamedTuple):
    """A part of the figure-eight in a log, from one share of its time to another."""

    log: str
    begin: float = 0.0
    end: float = 1.0

    def __str__(self) -> str:
        whole = (self.begin, self.end) == (0.0, 1.0)
        return self.log if whole else f"{self.log}, {self.begin:.0%} to {self.end:.0%}"


FIRST, SECOND = Part("px4-pvay", 0.0, 0.5), Part("px4-pvay", 0.5, 1.0)
FULL, PVY = Part("copter-full"), Part("copter-pvy")
FITS: Final = ((FULL, PVY), (PVY, FULL), (FIRST, SECOND))
"""Where drag and lag are fitted, and where they shall hold. The second only says how little the log
matters."""


class Percentiles(NamedTuple):
    """Of errors."""

    p50: float
    p95: float

    @classmethod
    def of(cls, errors: Array) -> Percentiles:
        """Of errors (n,)."""
        return cls(*np.percentile(errors, (50.0, 95.0)).tolist())


def settings(flight: RecordedFlight) -> dict[str, Any]:
    """The firmware's defaults as the recorded vehicle had them, for ``AutopilotConfig``. It was ready before
    it was asked, and told what a ground station expects."""
    return {"ready_after": 4.0, "streams": "normal", **_AS_RECORDED[flight.flavour]}


def trajectory(flight: RecordedFlight) -> list[tuple[float, SetpointLocal]]:
    """The set-points of the figure-eight and when they were sent (s): all that say position and velocity."""
    return [
        (time, message)
        for time, message in flight.sent
        if isinstance(message, SetpointLocal) and not message.type_mask & _TRAJECTORY
    ]


def during(flight: RecordedFlight, part: Part, rows: Array) -> Array:
    """Those of the rows (n, k), whose first column is time (s), that lie in a part of the figure-eight."""
    sent = trajectory(flight)
    begin, length = sent[0][0], sent[-1][0] - sent[0][0]
    shares = (rows[:, 0] - begin) / length
    return np.asarray(rows[(shares >= part.begin) & (shares <= part.end)])


def distances(flight: RecordedFlight, part: Part, track: Array) -> Array:
    """How far (n,), m, a track (m, 4), s and m, NED, is from the recorded one, whenever that was told."""
    there = during(flight, part, flight.told.track)
    here = np.column_stack([np.interp(there[:, 0], track[:, 0], x) for x in track[:, 1:].T])
    return np.asarray(np.linalg.norm(here - there[:, 1:], axis=1))


def turns(flight: RecordedFlight, part: Part, told: Told) -> Array:
    """How far (n,), rad, the yaw of another flight is from the recorded one's."""
    there = during(flight, part, flight.told.headings)
    here = np.interp(there[:, 0], told.headings[:, 0], np.unwrap(told.headings[:, 1]))
    return np.asarray(np.abs(np.remainder(here - there[:, 1] + np.pi, 2.0 * np.pi) - np.pi))
