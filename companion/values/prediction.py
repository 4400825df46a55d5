"""Double integrator over the horizon, as matrices: the A and B of the paper, eq. (8), stacked.

Deviation from the paper: A and B are 6 × 6 and 6 × 3, as the equation shows, not 3 × 3, as the text says; per
axis that leaves 2 × 2 and 2 × 1. With x and v the position and velocity on an axis at step 0, a (n,) the
accelerations of n steps and t (n,) their ends, velocities 1…n are v + S_v a and positions 1…n are
x + t v + S_x a.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Prediction(NamedTuple):
    """Matrices ``S_v``, ``S_x`` (n, n) from accelerations to velocities and positions.

    ``time`` (n,), s: t of steps 1…n.
    """

    S_v: Array
    S_x: Array
    time: Array


@lru_cache(maxsize=64)
def prediction(steps: int, dt: float) -> Prediction:
    """Return the matrices for ``steps`` inputs of ``dt`` (s) each."""
    k = np.arange(steps)
    lower = (k[:, None] >= k).astype(np.float64)
    parts = Prediction(
        dt * lower,
        np.asarray(dt**2 * (k[:, None] - k + 0.5) * lower),
        np.asarray(dt * (k + 1.0), dtype=np.float64),
    )
    for part in parts:
        part.flags.writeable = False
    return parts
