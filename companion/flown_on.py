"""Where a vehicle may be of which nothing has been heard for a while.

Its companion may have ended. Then the autopilot flies on by the last set-point until its time-out: at the
velocity, and for a second with the acceleration, that this had. (ArduCopter 4.6.3 was measured to follow
set-points that come once a second as well as those that come 50 times: so long it extrapolates both. For how
much longer is not known; GUID_TIMEOUT is 3 s.) One that was about to turn flies on into somebody. Or it has
stopped, as PX4 does after COM_OF_LOSS_T. So it is anywhere between: a ball that holds all of these places.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.horizon import Array

THRUSTING = 1.0
"""s for which the acceleration of the last set-point acts."""


class Ball(NamedTuple):
    """Centres (M, 3) and radii (M,), m."""

    centre: Array
    radius: Array


def flown_on(states: Array, accelerations: Array, seconds: Array, known: float) -> Ball:
    """Of vehicles with last ``states`` (M, 6), that meant to accelerate so (M, 3) then, ``seconds`` (M,) ago:
    between where they were when they could still be ``known`` (s), and where they may have been flown on
    to."""
    place, velocity = states[:, 0:3], states[:, 3:6]
    burn = np.minimum(seconds, THRUSTING)
    stopped = place + known * velocity
    coasted = place + seconds[:, None] * velocity
    driven = coasted + farthest(burn, seconds)[:, None] * accelerations
    centre = 0.5 * (stopped + driven)
    return Ball(centre, np.maximum(_norm(stopped - centre), _norm(coasted - centre)))


def farthest(burn: NDArray[np.float64], seconds: NDArray[np.float64]) -> Array:
    """m for each m/s² by which who accelerated for ``burn`` s and coasted then is further after
    ``seconds``."""
    return np.asarray(burn * (seconds - 0.5 * burn), dtype=np.float64)


def _norm(vectors: Array) -> Array:
    return np.asarray(np.sqrt(np.vecdot(vectors, vectors)), dtype=np.float64)
