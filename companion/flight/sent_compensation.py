"""Compensation of drag and wind in the set-points of a companion, for the backup node that continues them.

The backup node receives set-points, but no positions of the vehicle. What a companion adds to the planned
acceleration is c = κ v + w, with the drag κ per speed and a w that changes slowly (see ``tracking``). κ is
estimated from the last seconds of v and c; w then follows from the last set-point, so that the first one of
the backup node continues it without a step. Without this the compensation would end at once, and the
vehicle would leave its plan by decimetres until the autopilot's integral has replaced it.
"""

from __future__ import annotations

from math import exp

import numpy as np

from companion.flight.tracking import MAX_DRAG
from companion.values.horizon import Array

_TIME_CONSTANT_S = 3.0
"""Time (s) in which an observation loses its weight to 1/e."""
_LEAST_VARIANCE = 0.01
"""Variance of the speed (m²/s²) that is added to the estimate, so that a hover gives no drag."""
_MAX_PERIOD_S = 0.5
"""s between two observations; after a longer pause the estimate begins anew."""


class SentCompensation:
    """Compensation that was sent, with horizontal velocities v and compensations c (2,), m/s and m/s²."""

    def __init__(self) -> None:
        self._last: tuple[int, Array, Array] | None = None
        self._means: Array = np.zeros((2, 2))
        self._variance = self._covariance = 0.0

    def observe(self, now: int, velocity: Array, compensation: Array) -> None:
        """Observe the ``compensation`` of a set-point with the planned ``velocity`` at ``now`` (µs)."""
        sample = np.stack([velocity, compensation])
        dt = _MAX_PERIOD_S if self._last is None else 1e-6 * (now - self._last[0])
        if not 0.0 <= dt < _MAX_PERIOD_S:
            self._means, self._variance, self._covariance = sample, 0.0, 0.0
        keep = exp(-dt / _TIME_CONSTANT_S)
        off = sample - self._means
        self._means = self._means + (1.0 - keep) * off
        self._variance = keep * (self._variance + (1.0 - keep) * float(off[0] @ off[0]))
        self._covariance = keep * (self._covariance + (1.0 - keep) * float(off[0] @ off[1]))
        self._last = now, sample[0], sample[1]

    def at(self, velocity: Array) -> Array:
        """Return the compensation (3,), m/s², of a set-point with ``velocity`` (2,); its vertical is 0."""
        if self._last is None:
            return np.zeros(3)
        _, before, compensation = self._last
        drag = min(max(self._covariance / (self._variance + _LEAST_VARIANCE), 0.0), MAX_DRAG)
        return np.append(compensation + drag * (velocity - before), 0.0)
