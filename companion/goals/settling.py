"""Coming to a hover from which one may land: stop, still avoiding, and move aside of whoever is below."""

from __future__ import annotations

import numpy as np

from companion.config import CompanionConfig
from companion.values.horizon import Array, Motion
from companion.values.obstacles import Obstacles

_ASIDE = 0.5
"""m further than the clearance, when moving aside to land."""
_PASSES, _WAITS = 1.0, 5_000_000
"""m in a horizon: what moves further is passing, and for so long (µs) it is waited for."""
_NEAR = 1e-3
_EAST = np.array([1.0, 0.0])


class Settling:
    """Where to come to rest; ``clear`` once the vehicle is slow there and nobody is near horizontally,
    because landing is straight down."""

    def __init__(self, config: CompanionConfig) -> None:
        self._config = config
        self._rest: Array | None = None
        self._waiting_since: int | None = None
        self.clear = False

    def rest(self, now: int, measured: Motion, obstacles: Obstacles) -> Array:
        """The place (3,) to go to at ``now`` (µs): where braking from the first call on ends, or beside an
        obstacle that is in the way, since a landed vehicle will not go away. One that passes is waited for.
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
        """Which obstacle is nearest; None if it is far enough."""
        distance = np.linalg.norm(here[:2] - obstacles.positions[:, 0, :2], axis=1) - obstacles.radius
        if distance.min(initial=np.inf) > self._config.guard.landing_clearance:
            return None
        return int(np.argmin(distance))

    def _waits(self, now: int, positions: Array) -> bool:
        """Whether an obstacle at ``positions`` (N + 1, 3) passes, and not for too long."""
        way = positions[-1, :2] - positions[0, :2]
        if float(np.hypot(way[0], way[1])) < _PASSES:
            self._waiting_since = None
            return False
        self._waiting_since = now if self._waiting_since is None else self._waiting_since
        return now - self._waiting_since < _WAITS

    def _beside(self, here: Array, centre: Array, radius: float) -> Array:
        """A place (3,) clear of an obstacle at ``centre`` (3,)."""
        apart = here[:2] - centre[:2]
        size = float(np.hypot(apart[0], apart[1]))
        away = apart / size if size > _NEAR else _EAST
        room = radius + self._config.guard.landing_clearance + _ASIDE
        return np.append(centre[:2] + room * away, here[2])
