"""Ball that contains a vehicle from which nothing has been received for a while.

Its companion may have ended. Then the autopilot continues on the last set-point until its time-out: at that
set-point's velocity, and for one second with its acceleration. (Measured: ArduCopter 4.6.3 follows set-points
at 1 Hz as well as at 50 Hz, so it extrapolates both for at least a second. How much longer is not known;
GUID_TIMEOUT is 3 s.) A vehicle that was about to turn may then fly into another one. Or the vehicle has
stopped, as with PX4 after COM_OF_LOSS_T. It may be anywhere in between: the ball contains all these places.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from companion.values.horizon import Array

_ACCELERATION_S = 1.0
"""s for which the acceleration of the last set-point acts."""


class Ball(NamedTuple):
    """Centres (M, 3) and radii (M,), m."""

    centre: Array
    radius: Array


def flown_on(states: Array, accelerations: Array, seconds: Array, known: Array) -> Ball:
    """Return balls that contain vehicles whose last ``states`` (M, 6) are ``seconds`` (M,) old.

    ``accelerations`` (M, 3), m/s²: planned at that time. Each ball reaches from the vehicle's last certain
    position, at constant velocity ``known`` (M,) seconds after its last state, to where its autopilot may
    have flown since.
    """
    place, velocity = states[:, 0:3], states[:, 3:6]
    stopped = place + known[:, None] * velocity
    coasted = place + seconds[:, None] * velocity
    driven = coasted + further(seconds)[:, None] * accelerations
    centre = 0.5 * (stopped + driven)
    return Ball(centre, np.maximum(norms(stopped - centre), norms(coasted - centre)))


def further(seconds: Array) -> Array:
    """Return the extra distance per unit of acceleration (s²) after ``seconds`` (M,).

    The acceleration acts for ``_ACCELERATION_S`` at most.
    """
    burn = np.minimum(seconds, _ACCELERATION_S)
    return np.asarray(burn * (seconds - 0.5 * burn), dtype=np.float64)


def norms(vectors: Array) -> Array:
    """Return the norms (…) of ``vectors`` (…, 3)."""
    return np.asarray(np.sqrt(np.vecdot(vectors, vectors)), dtype=np.float64)
