"""Moment of a flight, as a log records it."""

from __future__ import annotations

from typing import NamedTuple

from sitl.estimation.sensors import Estimate


class Moment(NamedTuple):
    """Estimate at ``time`` (µs since boot), with its place (degrees, m above mean sea level)."""

    time: int
    estimate: Estimate
    latitude: float
    longitude: float
    altitude: float
    home_altitude: float
