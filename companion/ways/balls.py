"""Balls that others who rest cover on a way, as obstacles beside the fixed ones."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.values.horizon import Array

_INSIDE = 0.98
"""Share of its distance from a place to which a ball that holds this place is reduced."""
_ROUNDING = 1e-9
"""m."""


class Balls(NamedTuple):
    """Balls about ``centres`` (m, 3), m, of ``radii`` (m,), m.

    ``flat`` (m,): factors of heights, such as 1/2 for a ball that is twice as high as wide, and 0 for an
    endless column. The distance from a centre is ‖S Δ‖, S = diag(1, 1, flat): what vehicles keep from each
    other.
    """

    centres: Array
    radii: Array
    flat: Array

    def distance(self, points: Array) -> Array:
        """Return bounds (n,), m, from below on the distances of ``points`` (n, 3), m; ∞ without a ball.

        They are ‖S Δ‖ less the radius.
        """
        found = np.full(len(points), inf)
        for centre, radius, flat in zip(self.centres, self.radii.tolist(), self.flat.tolist(), strict=True):
            off = (points - centre) * (1.0, 1.0, flat)
            found = np.minimum(found, np.sqrt((off * off).sum(axis=1)) - radius)
        return found

    def without(self, place: Array) -> Balls:
        """Return the balls, reduced where they hold ``place`` (3,), m."""
        return self._replace(radii=np.minimum(self.radii, _INSIDE * self._off(self.centres - place)))

    def passed(self, places: Array, ends: Array) -> NDArray[np.bool_]:
        """Return whether the lines from ``places`` (k, 3) or (3,) to ``ends`` (k, 3), m, meet none, (k,)."""
        places = np.broadcast_to(places, ends.shape)
        centre, line = self.centres - places[:, None], (ends - places)[:, None]
        scale = np.stack([np.ones(len(self.flat)), np.ones(len(self.flat)), self.flat], axis=1)
        centre, line = centre * scale, line * scale
        square = np.maximum(np.vecdot(line, line), _ROUNDING**2)
        share = np.clip(np.vecdot(line, centre) / square, 0.0, 1.0)
        off = share[..., None] * line - centre
        result: NDArray[np.bool_] = (np.sqrt(np.vecdot(off, off)) >= self.radii - _ROUNDING).all(axis=1)
        return result

    def _off(self, offsets: Array) -> Array:
        """Return ‖S Δ‖ (m,) of ``offsets`` (m, 3) from the centres, m."""
        x, y, z = offsets.T
        result: Array = np.sqrt(x * x + y * y + (self.flat * z) ** 2)
        return result
