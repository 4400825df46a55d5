"""Neighbours that have been unheard for longer than usual: where they may be, and how fast to approach them.

A vehicle that hears nothing of a neighbour does not know whether that one hears it. If both fly on, each
avoids a place where the other is no longer. With ``guard.unheard_us`` each keeps clear of the places where an
unheard neighbour may be: a ball around its last course that grows with ``guard.unheard_speed``. Each comes
to rest outside the ball of the other, and near it is as slow as the ball grows. This is a rule of the field:
it makes violations rare, and proves nothing.

The field's distances stop growing at ``guard.neighbour_lost_us``. The ball that the vehicle does not approach
grows until ``guard.unheard_wait_us``: the neighbour may fly on while it hears nothing either. As long as that
the vehicle also stops before the plane in the middle between the places of both at that one's last message
(``middle_planes``). After that the neighbour counts as gone, because it must not hold up the others for ever,
and the smaller ball stays.
"""

from __future__ import annotations

from math import exp, inf

import numpy as np

from companion.config import CompanionConfig
from companion.obstacles.middle_planes import MiddlePlanes
from companion.obstacles.reachable_ball import norms
from companion.obstacles.relevance_filter import Ages
from companion.values.horizon import Array

_REACTION_S = 0.2
"""s at the present speed before a vehicle brakes: a plan, a set-point, and the tilt."""
_MEMORY_US = 5e6
"""µs in which a remembered silence becomes shorter by the factor e."""
_LEVEL = 1e-9


class Unheard:
    """The rule for one vehicle; ages (M,) are those of its neighbours' last states, µs."""

    def __init__(self, config: CompanionConfig) -> None:
        guard, field = config.guard, config.field
        self._after = guard.unheard_us or 0
        self._lost = guard.neighbour_lost_us
        self._waits = guard.unheard_wait_us
        self._growth = guard.unheard_speed
        self._d_min = field.d_min + field.margin(2)
        self._scale = np.array([1.0, 1.0, 1.0 / field.downwash])
        # Both stop before the plane: 2 d_min apart.
        self._planes = MiddlePlanes(self._d_min, self._scale)
        self._braking = min(config.limits.u_max)
        self._horizon_s = 1e-6 * config.horizon.dt_us * (config.horizon.steps + 1)
        # The longest silence (µs) of each neighbour, as far as it is remembered, at the last call.
        self._silences = np.zeros(0)
        self._called = 0

    def radii(self, ages: Ages | Array) -> Array:
        """Return by how much (m) the field's distances to neighbours grow, (M,); 0 for those just heard."""
        return self._grown(np.minimum(ages, self._lost))

    def _reached(self, ages: Ages) -> Array:
        """Return how far (m) neighbours may be beside their last course, (M,); the wait for them included."""
        return self._grown(np.where(ages <= self._waits, ages, np.minimum(ages, self._lost)))

    def _grown(self, ages: Ages | Array) -> Array:
        """Return the radius (m) of a ball that grows for ``ages`` (M,), µs."""
        silent = np.asarray(ages - self._after, dtype=np.float64)
        return np.asarray(1e-6 * self._growth * np.maximum(silent, 0.0))

    def pace(self, now: int, ages: Ages, here: Array, place: Array, towards: Array) -> float:
        """Return the speed (m/s) at which a vehicle at ``place`` (3,) may fly ``towards`` (3,), both m.

        ``here`` (M, 3), m: the neighbours, extrapolated. At that speed it comes to rest outside the ball of
        each unheard one, and near it flies no faster than the ball grows. Returns ∞ if there are none in this
        direction.
        """
        self._planes.note(now, ages, here, place)
        off, gap = self._gaps(now, ages, here, place)
        size = float(np.sqrt(towards @ towards))
        if size < _LEVEL:
            return inf
        planes = self._beside_planes(ages, place, towards / size)
        closing = off @ (towards * self._scale) / (size * np.maximum(norms(off), _LEVEL))
        ahead = closing > 0.0
        if not ahead.any():
            return planes
        gap = np.maximum(gap[ahead], 0.0)
        # Faster than the ball grows it flies only where a plan does not reach the ball.
        near = np.maximum(self._growth, gap / self._horizon_s - self._growth)
        return min(planes, float(np.min(np.minimum(self._stopping(gap), near) / closing[ahead])))

    def _beside_planes(self, ages: Ages, place: Array, direction: Array) -> float:
        """Return the speed (m/s) in ``direction`` (3,) at which it can stop before the middle planes."""
        silent = (ages > self._after) & (ages <= self._waits)
        gap, closing = self._planes.gaps(silent, place, direction)
        ahead = closing > 0.0
        if not ahead.any():
            return inf
        return float(np.min(self._stopping(np.maximum(gap[ahead], 0.0)) / closing[ahead]))

    def _stopping(self, gap: Array) -> Array:
        """Return the speeds (m/s) from which a vehicle comes to rest within ``gap`` (K,), m."""
        reach = self._braking * _REACTION_S
        return np.asarray(np.sqrt(reach * reach + 2.0 * self._braking * gap) - reach)

    def confined(self, now: int, ages: Ages, here: Array, place: Array, speed: float) -> bool:
        """Return whether a vehicle at ``place`` (3,), m, has to be slow: no faster than the balls grow.

        It has to where it could reach the ball of an unheard neighbour within a plan, at its present
        ``speed`` (m/s). Otherwise the field of places where nobody is would drive it into others.
        """
        _, gap = self._gaps(now, ages, here, place)
        return bool((gap < self._horizon_s * (speed + self._growth)).any())

    def _gaps(self, now: int, ages: Ages, here: Array, place: Array) -> tuple[Array, Array]:
        """Return the offsets (K, 3) of the unheard neighbours and their balls' distances (K,) from ``place``.

        Both are in m, in the ellipsoid of ``field.downwash``; a negative distance is inside.
        """
        silences = self._silence(now, ages)
        unheard = silences > self._after
        off = (here[unheard] - place) * self._scale
        return off, norms(off) - self._d_min - self._reached(ages[unheard])

    def _silence(self, now: int, ages: Ages) -> Array:
        """Return the present or the longest recent silence (M,), µs, of neighbours whose ages grow.

        A link that lost everything for a second may do so again: a neighbour heard just now is approached as
        one that falls silent now. A long silence is remembered hardly longer than a short one: at most
        ``guard.neighbour_lost_us`` of it counts.
        """
        before = np.zeros(len(ages))
        kept = np.minimum(self._silences, self._lost)
        before[: len(kept)] = kept * exp((self._called - now) / _MEMORY_US)
        self._called = now
        self._silences = np.maximum(ages.astype(np.float64), before)
        return self._silences
