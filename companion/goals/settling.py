"""Coming to a hover before landing: stop while avoiding obstacles, and move away from a near one."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from companion.avoidance.certified.margins import between, from_surfaces, further, margin
from companion.config import CompanionConfig
from companion.goals.roofs import Roofs
from companion.obstacles.static import FIRST_ID
from companion.values.horizon import Array, Motion
from companion.values.obstacles import Obstacles

_EXTRA_CLEARANCE_M = 0.5
"""Distance beyond the clearance when moving aside to land."""
_MIN_PASSING_M, _MAX_WAIT_US = 1.0, 5_000_000
"""Motion within a horizon above which an obstacle is passing, and the longest wait for it."""
_MIN_DISTANCE_M = 1e-3
_EAST = np.array([1.0, 0.0])


class Settling:
    """Place to come to rest before landing.

    ``clear``: whether no obstacle was near horizontally when ``rest`` was last called with a speed below
    ``guard.landing_speed``. Heights do not count, because landing is straight down. Near is within
    ``guard.landing_clearance`` of a surface. With committed plans it is also within the distance of two
    columns from a vehicle, and within what a column keeps from the surface of anything that flies no
    committed plan: posts, what is sensed, and the systems of ``unshared`` (the target, moving obstacles).
    ``roofs``: the fixed obstacles; those of ``config`` if None.
    """

    def __init__(
        self, config: CompanionConfig, unshared: Collection[int] = (), roofs: Roofs | None = None
    ) -> None:
        self._config, self._unshared = config, unshared
        self._roofs = Roofs(config.obstacles) if roofs is None else roofs
        self._from_vehicles = self._from_others = config.guard.landing_clearance
        if config.avoidance == "certified":
            self._from_vehicles = max(self._from_vehicles, between_columns(config))
            self._from_others = max(self._from_others, beside_column(config))
        self._rest: Array | None = None
        self._waiting_since: int | None = None
        self.clear = False

    def rest(self, now: int, measured: Motion, obstacles: Obstacles) -> Array:
        """Return the place (3,), m, to go to at ``now`` (µs).

        It is where braking from the first call on ends, clipped to the box; or a place beside a near
        obstacle, which may be a landed vehicle that stays there. From above or below a box it is the nearest
        side's that has room, if one has. The vehicle first waits for up to 5 s for an obstacle that passes.
        """
        config, here = self._config, measured.position
        speed = float(np.linalg.norm(measured.velocity))
        if self._rest is None:
            reach = speed / (2.0 * min(config.limits.weakest))
            low, high = np.minimum(config.limits.box_min, here), np.maximum(config.limits.box_max, here)
            self._rest = np.clip(here + reach * measured.velocity, low, high)
        if speed < config.guard.landing_speed:
            clearances = self._clearances(obstacles)
            nearest = self._in_the_way(here, obstacles, clearances)
            self.clear = nearest is None
            if nearest is None:
                self._waiting_since = None
            elif not self._waits(now, obstacles.positions[nearest]):
                radius = float(np.broadcast_to(obstacles.radius, len(obstacles.ids))[nearest])
                distance = radius + clearances[nearest] + _EXTRA_CLEARANCE_M
                out = self._out(here, obstacles.ids[nearest], distance)
                beside = self._beside(here, obstacles.positions[nearest, 0], distance)
                self._rest = beside if out is None else out
        return self._rest

    def _clearances(self, obstacles: Obstacles) -> Array:
        """Return within how many metres (M,) of the surface each obstacle is near."""
        vehicles = [id_ < FIRST_ID and id_ not in self._unshared for id_ in obstacles.ids]
        return np.where(vehicles, self._from_vehicles, self._from_others)

    def _in_the_way(self, here: Array, obstacles: Obstacles, clearances: Array) -> int | None:
        """Return the index of the obstacle that is nearest, compared with its clearance; None without one."""
        distance = np.linalg.norm(here[:2] - obstacles.positions[:, 0, :2], axis=1) - obstacles.radius
        excess = distance - clearances
        return None if excess.min(initial=np.inf) > 0.0 else int(np.argmin(excess))

    def _waits(self, now: int, positions: Array) -> bool:
        """Return whether an obstacle at ``positions`` (N + 1, 3) passes and may still be waited for."""
        motion = positions[-1, :2] - positions[0, :2]
        if float(np.hypot(motion[0], motion[1])) < _MIN_PASSING_M:
            self._waiting_since = None
            return False
        self._waiting_since = now if self._waiting_since is None else self._waiting_since
        return now - self._waiting_since < _MAX_WAIT_US

    def _out(self, here: Array, id_: int, distance: float) -> Array | None:
        """Return the place (3,), m, at the present height, ``distance`` (m) out of the box below or above.

        None if the obstacle is no such box, or if its four sides have no room.
        """
        limits, clear = self._config.limits, distance - 0.5 * _EXTRA_CLEARANCE_M
        low, high = np.array(limits.box_min)[:2], np.array(limits.box_max)[:2]
        place = self._roofs.way_out(id_ - FIRST_ID, here[:2], distance, clear, low, high)
        return None if place is None else np.append(place, here[2])

    def _beside(self, here: Array, centre: Array, distance: float) -> Array:
        """Return a place (3,), m, at the present height, at a ``distance`` (m) from ``centre`` (3,)."""
        offset = here[:2] - centre[:2]
        length = float(np.hypot(offset[0], offset[1]))
        away = offset / length if length > _MIN_DISTANCE_M else _EAST
        return np.append(centre[:2] + distance * away, here[2])


def between_columns(config: CompanionConfig) -> float:
    """Return the least distance (m) between two columns."""
    return between(config.certified, config.field, config.limits) + 2.0 * further(config.certified)


def beside_column(config: CompanionConfig) -> float:
    """Return the least distance (m) of a column from a surface that flies no committed plan."""
    certified, field, limits = config.certified, config.field, config.limits
    least = max(field.d_min + margin(certified, field, limits), from_surfaces(certified, field, limits))
    return least + further(certified)
