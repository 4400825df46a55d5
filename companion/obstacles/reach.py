"""How far neighbours may have come since they were heard last.

A vehicle that keeps ``SpeedBounds`` flies no faster than w of its own gap to each neighbour. If that gap is
not larger than the neighbour's gap to it, the neighbour may count on w of its own gap: the radius of the ball
around the last place grows at that speed. A vehicle that was faster when it was heard last is taken to brake
first.

This is a rule and no proof. A vehicle that hears the other one, or has overtaken it, may have the larger gap.
It then flies faster than the ball grows, leaves the ball, and may come near the other one from another side.

A vehicle to which a neighbour's last place itself is too near may leave it (``SpeedBounds.leaving``). As long
as that place is right and the other one does the same, their distance does not become smaller by it, and
beside other neighbours the bounds for these hold.
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
        self._gaps = np.zeros(0)
        self._earlier = [self._gaps, self._gaps]
        self._called = 0

    def grown(self, now: int, ages: Ages, speeds: Array, distances: Array, spread: Array) -> Array:
        """Return the radii (M,), m, at ``now`` (µs).

        ``ages`` (M,), µs, and ``speeds`` (M,), m/s, are those of the neighbours' last states, and ``spread``
        (M,), m, is how far these may be from the truth. ``distances`` (M,), m: from the own place to theirs,
        less what has to be kept. Rows are only ever added. A state of another time than at the last call
        counts as heard anew, also an older one: its radius is that of its age.
        """
        known, elapsed = len(self._ages), now - self._called
        heard = np.ones(len(ages), dtype=np.bool_)
        heard[:known] = ages[:known] != self._ages + elapsed
        radii = spread.copy()
        radii[:known] = np.where(heard[:known], radii[:known], self._radii)
        gaps = np.maximum(distances - radii, 0.0)
        if elapsed > 0:
            self._earlier = [self._gaps, self._earlier[0]]
        # At the beginning of the time since the last call the neighbour was as fast as the gap at its plan
        # before that allowed.
        widest = gaps.copy()
        for earlier in self._earlier:
            widest[: len(earlier)] = np.maximum(widest[: len(earlier)], earlier)
        coasting = speeds - 1e-6 * self._braking * ages
        rates = np.minimum(np.maximum(allowed(widest, self._braking, self._time), coasting), self._fastest)
        self._radii = radii + 1e-6 * np.where(heard, ages, elapsed) * rates
        self._ages, self._gaps, self._called = ages.copy(), gaps, now
        return self._radii
