"""Obstacles to avoid, aligned in time with the own horizon."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from companion.values.horizon import Array

_NO_EXTRA_RADIUS = np.zeros(1)
_NO_EXTRA_RADIUS.flags.writeable = False
_FULL_HEIGHT = np.ones(1)
_FULL_HEIGHT.flags.writeable = False


class Obstacles(NamedTuple):
    """M obstacles to avoid, aligned in time with the own horizon (fleet-local ENU, m).

    ``positions`` (M, N + 1, 3) are those at n = 0…N. ``d_min`` and ``d_safe`` (M,) are distances between
    centres and include ``radius`` (M,) or (1,), by which an obstacle is larger than a vehicle: its own size,
    and a margin for the uncertainty of its position. ``ids`` identify the obstacles for logs, and for
    methods that store on which side they pass an obstacle. ``heights`` (M,) or (1,): number by which
    differences in height count in the distance, less than 1 for vehicles with downwash.
    """

    ids: tuple[int, ...]
    positions: Array
    d_min: Array
    d_safe: Array
    radius: Array = _NO_EXTRA_RADIUS
    heights: Array = _FULL_HEIGHT

    def joined(self, others: Obstacles) -> Obstacles:
        """Return these obstacles and ``others`` together."""
        if not others.ids:
            return self
        return Obstacles(
            self.ids + others.ids,
            np.concatenate([self.positions, others.positions]),
            np.concatenate([self.d_min, others.d_min]),
            np.concatenate([self.d_safe, others.d_safe]),
            np.concatenate([np.broadcast_to(part.radius, len(part.ids)) for part in (self, others)]),
            np.concatenate([np.broadcast_to(part.heights, len(part.ids)) for part in (self, others)]),
        )

    def without(self, ids: range) -> Obstacles:
        """Return the obstacles whose ids are not among ``ids``."""
        kept = [row for row, id_ in enumerate(self.ids) if id_ not in ids]
        if len(kept) == len(self.ids):
            return self
        return Obstacles(
            tuple(self.ids[row] for row in kept),
            self.positions[kept],
            self.d_min[kept],
            self.d_safe[kept],
            np.broadcast_to(self.radius, len(self.ids))[kept],
            np.broadcast_to(self.heights, len(self.ids))[kept],
        )

    def shared(self, systems: Collection[int], spacing: float) -> Obstacles:
        """Return the obstacles with d_safe of those of ``systems`` lowered to ``spacing`` (m).

        ``spacing`` is the distance that they and the own vehicle shall keep. d_safe is not raised, and not
        lowered to less than 1 m above d_min.
        """
        if not any(id_ in systems for id_ in self.ids):
            return self
        selected = np.array([id_ in systems for id_ in self.ids])
        lowered = np.maximum(self.d_min + _MIN_WIDTH_M, spacing)
        return self._replace(d_safe=np.where(selected, np.minimum(self.d_safe, lowered), self.d_safe))


_MIN_WIDTH_M = 1.0
"""Least difference (m) kept between d_min and d_safe."""
