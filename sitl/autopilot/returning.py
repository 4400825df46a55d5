"""Return to home: climb, fly over home, pause, land."""

from __future__ import annotations

import math
from enum import Enum
from typing import Final

from mavlink_bridge.messages import Vector
from sitl.autopilot.guidance import Guidance
from sitl.config.autopilot import AutopilotConfig
from sitl.estimation.sensors import Estimate
from sitl.values.home import Home

_ARRIVAL_DISTANCE: Final = 0.5  # m
_MIN_BEARING_DISTANCE: Final = 1.0  # m, below which the yaw is kept


class _Stage(Enum):
    IDLE = "idle"
    CLIMB = "climb"
    OVER = "over"
    PAUSE = "pause"
    DOWN = "down"


class Returning:
    """RTL of both firmwares.

    The vehicle climbs to the return height above home, or keeps its height if that is greater, flies over
    home, pauses and lands. With a negative ``return_pause`` it stays over home.
    """

    def __init__(self, guidance: Guidance, home: Home, config: AutopilotConfig) -> None:
        self._guidance = guidance
        self._home = home
        self._config = config
        self._stage = _Stage.IDLE
        self._target: Vector = (0.0, 0.0, 0.0)
        self._until = 0

    def configure(self, config: AutopilotConfig) -> None:
        """Use new settings from now on."""
        self._config = config

    def begin(self, here: Estimate) -> None:
        """Start the return from ``here``."""
        north, east, down = here.position
        height = max(self._home.height + self._config.return_height, -down)
        self._go((north, east, -height), self._config.waypoint_climb, None, here)
        self._stage = _Stage.CLIMB

    def end(self) -> None:
        """Reset: no return is in progress."""
        self._stage = _Stage.IDLE

    def advance(self, now: int, here: Estimate) -> None:
        """Continue the return; call this in each step at ``now`` (µs)."""
        if self._stage is _Stage.PAUSE:
            if now >= self._until and self._config.return_pause >= 0.0:
                self._guidance.land(self._config.land_speed)
                self._stage = _Stage.DOWN
        elif self._stage in (_Stage.CLIMB, _Stage.OVER) and self._is_there(here):
            if self._stage is _Stage.CLIMB:
                x, y, _ = self._home.position
                north, east = x - here.position[0], y - here.position[1]
                yaw = math.atan2(east, north) if math.hypot(north, east) > _MIN_BEARING_DISTANCE else None
                self._go((x, y, self._target[2]), self._config.waypoint_speed, yaw, here)
                self._stage = _Stage.OVER
            else:
                self._until = now + round(max(0.0, self._config.return_pause) * 1e6)
                self._stage = _Stage.PAUSE

    def _is_there(self, here: Estimate) -> bool:
        return math.dist(here.position, self._target) <= _ARRIVAL_DISTANCE

    def _go(self, target: Vector, speed: float, yaw: float | None, here: Estimate) -> None:
        self._target = target
        self._guidance.go(target, speed, yaw, here.pose)
