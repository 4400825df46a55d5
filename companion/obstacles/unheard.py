"""Neighbours that have been unheard for longer than usual: where they may be, and how fast to approach them.

A vehicle that hears nothing of a neighbour does not know whether that one hears it. If both fly on, each
avoids a place where the other is no longer. With ``guard.unheard_us`` each keeps clear of the places where an
unheard neighbour may be: a ball around its last course that grows with ``guard.unheard_speed``. Each comes
to rest outside the ball of the other, and near it is as slow as the ball grows. This is a rule of the field:
it makes violations rare, and proves nothing.

The ball stops growing at ``guard.neighbour_lost_us``: a vehicle that is gone must not hold up the others for
ever. Approaching it after that is slow, because the ball stays.
"""

from __future__ import annotations

from math import inf

import numpy as np

from companion.config import CompanionConfig
from companion.obstacles.reachable_ball import norms
from companion.obstacles.relevance_filter import Ages
from companion.values.horizon import Array

_REACTION_S = 0.2
"""s at the present speed before a vehicle brakes: a plan, a set-point, and the tilt."""
_FORGOTTEN = 0.1
"""Share of time by which a remembered silence becomes shorter: one of 1 s is forgotten in 10 s."""
_LEVEL = 1e-9


class Unheard:
    """The rule for one vehicle; ages (M,) are those of its neighbours' last states, µs."""

    def __init__(self, config: CompanionConfig) -> None:
        guard, field = config.guard, config.field
        self._after = guard.unheard_us or 0
        self._most = max(guard.neighbour_lost_us - self._after, 0)
        self._growth = guard.unheard_speed
        self._d_min = field.d_min + field.margin(2)
        self._scale = np.array([1.0, 1.0, 1.0 / field.downwash])
        self._braking = min(config.limits.u_max)
        self._horizon_s = 1e-6 * config.horizon.dt_us * (config.horizon.steps + 1)
        # The longest silence (µs) of each neighbour, as far as it is remembered, at the last call.
        self._silences = np.zeros(0)
        self._called = 0

    def radii(self, ages: Ages | Array) -> Array:
        """Return by how much (m) neighbours may be beside their last course, (M,); 0 for those just heard."""
        silent = np.asarray(ages - self._after, dtype=np.float64)
        return np.asarray(1e-6 * self._growth * np.clip(silent, 0.0, self._most))

    def pace(self, now: int, ages: Ages, here: Array, place: Array, towards: Array) -> float:
        """Return the speed (m/s) at which a vehicle at ``place`` (3,) may fly ``towards`` (3,), both m.

        ``here`` (M, 3), m: the neighbours, extrapolated. At that speed it comes to rest outside the ball of
        each unheard one, and near it flies no faster than the ball grows. Returns ∞ if there are none in this
        direction.
        """
        off, gap = self._gaps(now, ages, here, place)
        size = float(np.sqrt(towards @ towards))
        if size < _LEVEL:
            return inf
        closing = off @ (towards * self._scale) / (size * np.maximum(norms(off), _LEVEL))
        ahead = closing > 0.0
        if not ahead.any():
            return inf
        # The neighbour, too, comes nearer while this vehicle brakes.
        reach = self._braking * _REACTION_S
        gap = np.maximum(gap[ahead], 0.0)
        stopping = np.sqrt(reach * reach + 2.0 * self._braking * gap) - reach
        # Faster than the ball grows it flies only where a plan does not reach the ball.
        speeds = np.minimum(stopping, np.maximum(self._growth, gap / self._horizon_s - self._growth))
        return float(np.min(speeds / closing[ahead]))

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
        return off, norms(off) - self._d_min - self.radii(silences[unheard])

    def _silence(self, now: int, ages: Ages) -> Array:
        """Return the present or the longest recent silence (M,), µs, of neighbours whose ages grow.

        A link that lost everything for a second may do so again: a neighbour heard just now is approached as
        one that falls silent now.
        """
        before = np.zeros(len(ages))
        before[: len(self._silences)] = self._silences - _FORGOTTEN * (now - self._called)
        self._called = now
        self._silences = np.maximum(ages.astype(np.float64), before)
        return self._silences
