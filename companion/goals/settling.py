"""Coming to a hover before landing: stop while avoiding obstacles, and move aside of one that is below."""

from __future__ import annotations

import numpy as np

from companion.config import CompanionConfig
from companion.values.horizon import Array, Motion
from companion.values.obstacles import Obstacles

_ASIDE = 0.5
"""Distance (m) beyond the clearance when moving aside to land."""
_PASSES, _WAITS = 1.0, 5_000_000
"""Motion (m in a horizon) above which an obstacle is passing, and how long (µs) to wait for it."""
_NEAR = 1e-3
_EAST = np.array([1.0, 0.0])


class Settling:
    """Place to come to rest before landing.

    ``clear`` is set once the vehicle is slow there and no obstacle is near horizontally, because landing is
    straight down.
    """

    def __init__(self, config: CompanionConfig) -> None:
        self._config = config
        self._rest: Array | None = None
        self._waiting_since: int | None = None
        self.clear = False

    def rest(self, now: int, measured: Motion, obstacles: Obstacles) -> Array:
        """Return the place (3,), m, to go to at ``now`` (µs).

        It is where braking from the first call on ends, or beside an obstacle that is in the way, since a
        landed vehicle will not go away. The vehicle waits for an obstacle that passes.
        """
        config, here = self._config, measured.position
        speed = float(np.linalg.norm(measured.velocity))
        if self._rest is None:
            reach = speed / (2.0 * min(config.limits.u_max))
            low, high = np.minimum(config.limits.box_min, here), np.maximum(config.limits.box_max, here)
            self._rest = np.clip(here + reach * measured.velocity, low, high)
        if speed < config.guard.landing_speed:
            nearest = self._in_the_way(here, obstacles)
            self.clear = nearest is None
            if nearest is None:
                self._waiting_since = None
            elif not self._waits(now, obstacles.positions[nearest]):
                radius = float(np.broadcast_to(obstacles.radius, len(obstacles.ids))[nearest])
                self._rest = self._beside(here, obstacles.positions[nearest, 0], radius)
        return self._rest

    def _in_the_way(self, here: Array, obstacles: Obstacles) -> int | None:
        """Return the index of the nearest obstacle; None if it is far enough away."""
        distance = np.linalg.norm(here[:2] - obstacles.positions[:, 0, :2], axis=1) - obstacles.radius
        if distance.min(initial=np.inf) > self._config.guard.landing_clearance:
            return None
        return int(np.argmin(distance))

    def _waits(self, now: int, positions: Array) -> bool:
        """Return whether an obstacle at ``positions`` (N + 1, 3) passes and may still be waited for."""
        way = positions[-1, :2] - positions[0, :2]
        if float(np.hypot(way[0], way[1])) < _PASSES:
            self._waiting_since = None
            return False
        self._waiting_since = now if self._waiting_since is None else self._waiting_since
        return now - self._waiting_since < _WAITS

    def _beside(self, here: Array, centre: Array, radius: float) -> Array:
        """Return a place (3,), m, clear of an obstacle at ``centre`` (3,)."""
        apart = here[:2] - centre[:2]
        size = float(np.hypot(apart[0], apart[1]))
        away = apart / size if size > _NEAR else _EAST
        room = radius + self._config.guard.landing_clearance + _ASIDE
        return np.append(centre[:2] + room * away, here[2])
