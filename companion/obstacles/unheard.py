"""Neighbours that have been unheard for longer than usual: where they may be, and how fast to fly there.

A vehicle that hears nothing of a neighbour does not know whether that one hears it. If both fly on, each
avoids a place where the other is no longer. With ``guard.unheard_us`` each keeps clear of the places where an
unheard neighbour may be (``Reach``): it stops before them, and the nearer they are the slower it flies, in
every direction (``SpeedBounds``), because the others count on that. If it is already too near to the last
state of a neighbour, it may leave with ``guard.unheard_speed``. The field's distances to the neighbour
grow, too, until ``guard.neighbour_lost_us``. A neighbour that has been silent for longer than
``guard.unheard_wait_us`` counts as gone, because it must not hold up the others for ever: then only a ball
of the size to which the field's distances have grown remains. This is a rule of the field and no proof.
"""

from __future__ import annotations

from math import exp, hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.config import CompanionConfig
from companion.obstacles.reach import Reach
from companion.obstacles.reachable_ball import norms
from companion.obstacles.relevance_filter import Ages
from companion.values.horizon import Array
from companion.values.speed_bounds import SpeedBounds

_MEMORY_US = 5e6
"""µs in which a remembered silence becomes shorter by the factor e."""
_TIME_S = 1.0
"""s that a vehicle needs at least to the nearest place where an unheard neighbour may be (T)."""
_PLAN_ERROR_M = 0.3
"""m: usual deviation of a vehicle from its plan."""
_LEVEL = 1e-9


class Heard(NamedTuple):
    """What was heard last of each neighbour: ``states`` (M, 6), m and m/s, that are ``ages`` (M,), µs, old.

    ``planned`` (M,): whether the state is the beginning of a plan, and not measured.
    """

    ages: Ages
    states: Array
    planned: NDArray[np.bool_]


class Unheard:
    """The rule for one vehicle."""

    def __init__(self, config: CompanionConfig) -> None:
        guard, field, limits = config.guard, config.field, config.limits
        self._after = guard.unheard_us or 0
        self._lost = guard.neighbour_lost_us
        self._waits = guard.unheard_wait_us
        self._growth = guard.unheard_speed
        self._d_min = field.d_min + field.margin(2)
        self._scale = np.array([1.0, 1.0, 1.0 / field.downwash])
        self._planar = config.planar
        self._braking, self._time = min(limits.weakest), _TIME_S
        self._reach = Reach(self._braking, self._time, hypot(*limits.fastest))
        # The longest silence (µs) of each neighbour, as far as it is remembered, at the last call.
        self._silences = np.zeros(0)
        self._called = 0

    def radii(self, ages: Ages | Array) -> Array:
        """Return by how much (m) the field's distances to neighbours grow, (M,); 0 for those just heard.

        ``ages`` (M,), µs: of their last states.
        """
        silent = np.asarray(np.minimum(ages, self._lost) - self._after, dtype=np.float64)
        return np.asarray(1e-6 * self._growth * np.maximum(silent, 0.0))

    def bounds(self, now: int, heard: Heard, place: Array) -> SpeedBounds | None:
        """Return the bounds for a vehicle at ``place`` (3,), m; None if it hears all others.

        They are in the ellipsoid of ``field.downwash``, in which no speed is larger than it is.
        """
        ages = heard.ages
        off = (heard.states[:, 0:3] - place) * self._scale
        distances = norms(off)
        clear, speeds = distances - self._d_min, norms(heard.states[:, 3:6])
        spread = np.where(heard.planned, _PLAN_ERROR_M, 0.0)
        reach = self._reach.grown(now, ages, speeds, clear, spread)
        unheard = self._silence(now, ages) > self._after
        if not unheard.any():
            return None
        gone = ages > self._waits
        reach = np.where(gone, np.minimum(reach, self.radii(ages)), reach)
        normals = off * self._scale / np.maximum(distances, _LEVEL)[:, None]
        if self._planar:
            normals[:, 2] = 0.0
        return SpeedBounds(
            place,
            np.ascontiguousarray(normals[unheard]),
            np.maximum(clear - reach, 0.0)[unheard],
            np.where(gone, self._growth, 0.0)[unheard],
            np.where(clear <= spread, self._growth, 0.0)[unheard],
            self._braking,
            self._time,
        )

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
