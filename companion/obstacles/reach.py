"""How far neighbours may have come since they were heard last.

A vehicle that keeps ``SpeedBounds`` is fast only far from all whose places it is not sure of, and it is never
nearer to another one than its own bound for it says. So the other one, at a true gap g, sees it come no
faster than w(g): the radius around the last place in which it may be grows with w of the gap that is left.
This holds whatever either of the two hears: loss need not be symmetric, and silence may last as long as it
likes. A vehicle that was faster when it was heard last is taken to brake first.
"""

from __future__ import annotations

import numpy as np

from companion.obstacles.relevance_filter import Ages
from companion.values.horizon import Array
from companion.values.speed_bounds import allowed


class Reach:
    """Radii for the neighbours of one vehicle, at the last call.

    ``braking`` (m/s²) and ``time`` (s) are b and T of ``SpeedBounds``; nobody is faster than ``fastest``
    (m/s).
    """

    def __init__(self, braking: float, time: float, fastest: float) -> None:
        self._braking, self._time, self._fastest = braking, time, fastest
        self._radii = np.zeros(0)
        self._ages = np.zeros(0, dtype=np.int64)
        self._called = 0

    def grown(self, now: int, ages: Ages, speeds: Array, distances: Array, spread: Array) -> Array:
        """Return the radii (M,), m, at ``now`` (µs).

        ``ages`` (M,), µs, and ``speeds`` (M,), m/s, are those of the neighbours' last states, and ``spread``
        (M,), m, is how far these may be from the truth. ``distances`` (M,), m: from the own place to theirs,
        less what has to be kept. Rows are only ever added.
        """
        known, elapsed = len(self._ages), now - self._called
        heard = np.ones(len(ages), dtype=np.bool_)
        heard[:known] = ages[:known] < self._ages + elapsed
        radii = spread.copy()
        radii[:known] = np.where(heard[:known], radii[:known], self._radii)
        gaps = np.maximum(distances - radii, 0.0)
        coasting = speeds - 1e-6 * self._braking * ages
        rates = np.minimum(np.maximum(allowed(gaps, self._braking, self._time), coasting), self._fastest)
        self._radii = radii + 1e-6 * np.where(heard, ages, elapsed) * rates
        self._ages, self._called = ages.copy(), now
        return self._radii
