"""What ORCA is flown by: each combination of a few values."""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple

from benchmarks.integrators import Manner


class Setting(NamedTuple):
    """``radius_m`` of a disc, ``horizon_s`` for which it shall not collide, and the `Manner` of the velocity
    that is preferred."""

    radius_m: float
    horizon_s: float
    turned_deg: float
    braking: float
    gain: float

    @property
    def manner(self) -> Manner:
        """How each would fly if it were alone."""
        return Manner(self.braking, self.gain, math.radians(self.turned_deg))


RADII, HORIZONS, TURNS = (0.25, 0.3, 0.35, 0.5), (0.5, 1.0, 2.0), (0.0, 10.0, 20.0)
STOPS = ((1.6, 2.0), (1.8, 3.0))
"""Braking and gain: the first leaves more to give way with; who is alone is 0.2 s sooner there by the
second."""
SETTINGS = tuple(
    Setting(radius, horizon, turned, *stop)
    for radius, horizon, turned, stop in product(RADII, HORIZONS, TURNS, STOPS)
)
