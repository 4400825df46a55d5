"""Middle planes between a vehicle and neighbours that have fallen silent, where both were at that time.

Two vehicles whose link is cut have last heard of each other at about the same time. Each stays on its side
of the plane in the middle between the two places, as far as it can still brake before it: then they do not
meet, however long the cut lasts. These are the cells of Zhou et al., "Fast, On-line Collision Avoidance for
Dynamic Vehicles Using Buffered Voronoi Cells" (2017), with the places of the last message in place of the
present ones.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.obstacles.reachable_ball import norms
from companion.obstacles.relevance_filter import Ages
from companion.values.horizon import Array

_LEVEL = 1e-9


class MiddlePlanes:
    """Planes of one vehicle, which stays ``buffer`` (m) before them.

    ``scale`` (3,) is by how much each axis counts in a distance (``field.downwash``).
    """

    def __init__(self, buffer: float, scale: Array) -> None:
        self._buffer, self._scale = buffer, scale
        # Own place and the neighbour's (M, 3), m, when it was heard last; its age (µs) at the last call.
        self._own = self._other = np.zeros((0, 3))
        self._ages = np.zeros(0, dtype=np.int64)
        self._called = 0

    def note(self, now: int, ages: Ages, here: Array, place: Array) -> None:
        """Note ``here`` (M, 3) of those heard since the last call, and the own ``place`` (3,), m.

        ``now`` and ``ages`` (M,), µs. Rows are only ever added.
        """
        known = len(self._ages)
        heard = np.ones(len(ages), dtype=bool)
        heard[:known] = ages[:known] < self._ages + (now - self._called)
        own, other = np.empty((len(ages), 3)), np.empty((len(ages), 3))
        own[:known], other[:known] = self._own, self._other
        own[heard], other[heard] = place, here[heard]
        self._own, self._other, self._ages, self._called = own, other, ages.copy(), now

    def gaps(self, rows: NDArray[np.bool_], place: Array, towards: Array) -> tuple[Array, Array]:
        """Return how far (K,), m, the planes of ``rows`` (M,) are from ``place`` (3,), m, less the buffer.

        Returns also by how much (K,) that decreases with each metre ``towards`` (3,), a unit vector.
        """
        apart = (self._other[rows] - self._own[rows]) * self._scale
        distances = norms(apart)
        normals = apart / np.maximum(distances, _LEVEL)[:, None]
        flown = np.sum((place - self._own[rows]) * self._scale * normals, axis=1)
        return 0.5 * distances - self._buffer - flown, normals @ (towards * self._scale)
