"""Phases of a flight."""

from __future__ import annotations

from enum import Enum


class Phase(Enum):
    """Phase of the flight."""

    CONNECT = "connect"
    PREPARE = "prepare"
    ESCORT = "escort"
    HOLD = "hold"
    RETURN = "return"
    SETTLE = "settle"
    LAND = "land"
    DONE = "done"
    YIELDED = "yielded"


UNDER_WAY = (Phase.ESCORT, Phase.RETURN)
"""Phases in which a vehicle flies to a destination; while it holds or settles it stays about where it is."""
STEERED = (Phase.ESCORT, Phase.HOLD, Phase.RETURN, Phase.SETTLE)
"""Phases in which set-points steer, as long as the autopilot follows them."""
