"""The phases of a flight."""

from __future__ import annotations

from enum import Enum


class Phase(Enum):
    """Where the flight is."""

    CONNECT = "connect"
    PREPARE = "prepare"
    ESCORT = "escort"
    HOLD = "hold"
    RETURN = "return"
    SETTLE = "settle"
    LAND = "land"
    DONE = "done"
    YIELDED = "yielded"


STEERED = (Phase.ESCORT, Phase.HOLD, Phase.RETURN, Phase.SETTLE)
"""The phases in which set-points steer, as long as the autopilot lets them."""
