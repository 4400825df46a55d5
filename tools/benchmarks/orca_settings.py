"""Settings for ORCA: each combination of a few values."""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple

from benchmarks.integrators import FreeMotion


class Setting(NamedTuple):
    """Setting of ORCA.

    ``radius_m`` is the radius of a disc (m), ``horizon_s`` the time (s) for which it must not collide; the
    rest is the `Manner` of the preferred velocity.
    """

    radius_m: float
    horizon_s: float
    turned_deg: float
    braking: float
    gain: float

    @property
    def manner(self) -> FreeMotion:
        """Motion of a vehicle without neighbours."""
        return FreeMotion(self.braking, self.gain, math.radians(self.turned_deg))


RADII, HORIZONS, TURNS = (0.25, 0.3, 0.35, 0.5), (0.5, 1.0, 2.0), (0.0, 10.0, 20.0)
STOPS = ((1.6, 2.0), (1.8, 3.0))
"""Braking (m/s²) and gain (1/s).

The first pair leaves more acceleration for avoidance; with the second a vehicle without neighbours arrives
0.2 s sooner.
"""
SETTINGS = tuple(
    Setting(radius, horizon, turned, *stop)
    for radius, horizon, turned, stop in product(RADII, HORIZONS, TURNS, STOPS)
)
