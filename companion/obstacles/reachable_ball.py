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

from companion.values.horizon import Array

_THRUSTING = 1.0
"""s for which the acceleration of the last set-point acts."""


class Ball(NamedTuple):
    """Centres (M, 3) and radii (M,), m."""

    centre: Array
    radius: Array


def flown_on(states: Array, accelerations: Array, seconds: Array, known: Array) -> Ball:
    """Of vehicles with last ``states`` (M, 6), that meant to accelerate so (M, 3) then, ``seconds`` (M,) ago:
    between where they were when they could still be ``known`` (M,), s, and where they may have been flown on
    to."""
    place, velocity = states[:, 0:3], states[:, 3:6]
    stopped = place + known[:, None] * velocity
    coasted = place + seconds[:, None] * velocity
    driven = coasted + further(seconds)[:, None] * accelerations
    centre = 0.5 * (stopped + driven)
    return Ball(centre, np.maximum(norms(stopped - centre), norms(coasted - centre)))


def further(seconds: Array) -> Array:
    """m for each m/s² by which who accelerated as long as that lasts is further after ``seconds`` (M,)."""
    burn = np.minimum(seconds, _THRUSTING)
    return np.asarray(burn * (seconds - 0.5 * burn), dtype=np.float64)


def norms(vectors: Array) -> Array:
    """Of vectors (…, 3)."""
    return np.asarray(np.sqrt(np.vecdot(vectors, vectors)), dtype=np.float64)
