"""Balls that others who rest cover on a way, as obstacles beside the fixed ones."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np

from companion.values.horizon import Array


class Balls(NamedTuple):
    """Balls about ``centres`` (m, 3), m, of ``radii`` (m,), m; ``high``: how many times as high as wide."""

    centres: Array
    radii: Array
    high: float = 1.0

    def distance(self, points: Array) -> Array:
        """Return bounds (n,), m, from below on the distances of ``points`` (n, 3), m; ∞ without a ball.

        They are ‖S Δ‖ less the radius, S = diag(1, 1, 1/high): what vehicles keep from each other.
        """
        found = np.full(len(points), inf)
        scale = np.array([1.0, 1.0, 1.0 / self.high])
        for centre, radius in zip(self.centres, self.radii.tolist(), strict=True):
            off = (points - centre) * scale
            found = np.minimum(found, np.sqrt((off * off).sum(axis=1)) - radius)
        return found
