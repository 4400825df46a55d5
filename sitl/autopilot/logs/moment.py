"""What a log records: moments of a flight, and parameters."""

from __future__ import annotations

from typing import NamedTuple

from sitl.estimation.sensors import Estimate


class Moment(NamedTuple):
    """Estimate at ``time`` (µs since boot, by the vehicle's clock).

    With its place (degrees, m above mean sea level).
    """

    time: int
    estimate: Estimate
    latitude: float
    longitude: float
    altitude: float
    home_altitude: float


class LoggedParameter(NamedTuple):
    """Value and default of a parameter; ``whole``: it is an integer."""

    name: str
    value: float
    default: float
    whole: bool
