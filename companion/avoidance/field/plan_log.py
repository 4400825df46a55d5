"""Log of every plan: its time, and ∇J, which shows how far the vehicle is from its destination."""

from __future__ import annotations

from array import array

import numpy as np
from numpy.typing import NDArray

from companion.values.horizon import Array


class PlanLog:
    """Log that grows by 20 bytes a plan: 7 MB in an hour at 100 Hz."""

    def __init__(self) -> None:
        self._times = array("q")
        self._gradients = array("f")

    def add(self, time: int, gradient: Array) -> None:
        """Add a plan made at ``time`` (µs) with ∇J (3,), divided by Ω_t."""
        self._times.append(time)
        self._gradients.extend(gradient.tolist())

    @property
    def times(self) -> NDArray[np.int64]:
        """Times (n,) at which plans were made, µs."""
        return np.array(self._times, dtype=np.int64)

    @property
    def gradients(self) -> Array:
        """∇J of each plan (n, 3), divided by Ω_t."""
        return np.array(self._gradients, dtype=np.float64).reshape(-1, 3)
