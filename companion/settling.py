"""Coming to a hover from which one may land: stop, still avoiding, and move aside of whoever is below."""

from __future__ import annotations

import numpy as np

from companion.config import CompanionConfig
from companion.forces import Obstacles
from companion.horizon import Array, Motion

_ASIDE = 0.5
"""m further than the clearance, when moving aside to land."""
_NEAR = 1e-3
_EAST = np.array([1.0, 0.0])


class Settling:
    """Where to come to rest; ``clear`` once the vehicle is slow there and nobody is near horizontally,
    because landing is straight down."""

    def __init__(self, config: CompanionConfig) -> None:
        self._config = config
        self._rest: Array | None = None
        self.clear = False

    def rest(self, measured: Motion, obstacles: Obstacles) -> Array:
        """The place (3,) to go to: where braking from the first call on ends, or beside an obstacle that is
        in the way, since a landed vehicle will not go away."""
        config, here = self._config, measured.position
        speed = float(np.linalg.norm(measured.velocity))
        if self._rest is None:
            reach = speed / (2.0 * min(config.limits.u_max))
            low, high = np.minimum(config.limits.box_min, here), np.maximum(config.limits.box_max, here)
            self._rest = np.clip(here + reach * measured.velocity, low, high)
        if speed < config.guard.landing_speed:
            beside = self._beside(here, obstacles)
            self.clear = beside is None
            self._rest = self._rest if beside is None else beside
        return self._rest

    def _beside(self, here: Array, obstacles: Obstacles) -> Array | None:
        """A place (3,) clear of the nearest obstacle; None if it is far enough."""
        clearance = self._config.guard.landing_clearance
        apart = here[:2] - obstacles.positions[:, 0, :2]
        centres = np.sqrt(np.vecdot(apart, apart))
        distance = centres - obstacles.radius
        if distance.min(initial=np.inf) > clearance:
            return None
        nearest = int(np.argmin(distance))
        away = apart[nearest] / centres[nearest] if centres[nearest] > _NEAR else _EAST
        room = float(centres[nearest] - distance[nearest]) + clearance + _ASIDE
        return np.append(obstacles.positions[nearest, 0, :2] + room * away, here[2])
