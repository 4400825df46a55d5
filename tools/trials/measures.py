"""Quality of a flight: figures of tracks and set-points, values only.

Times are s of the trial, positions m in the fleet frame (ENU).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trials.separation import Track

Array = NDArray[np.float64]
TOGETHER = 0.1
"""Longest interval that counts as a step between set-points (s); a longer one is a gap."""
NEAR, HELD = 0.75, 3.0
"""Convergence criterion: distance from the surface (m), and how long it must be kept (s)."""
_STEP = 0.02
"""Time between two samples (s)."""


class Spread(NamedTuple):
    """Median, 95th percentile and maximum of some values."""

    p50: float
    p95: float
    max: float


class Setpoints(NamedTuple):
    """Set-points of one companion.

    ``times`` (n,) are of the trial, ``clock`` (n,) the same by the companion's own clock; ``places``,
    ``velocities`` and ``accelerations`` are (n, 3).
    """

    times: Array
    clock: Array
    places: Array
    velocities: Array
    accelerations: Array

    def between(self, begin: float, end: float) -> Setpoints:
        """Return the set-points from ``begin`` to ``end`` (s)."""
        chosen = (self.times >= begin) & (self.times <= end)
        return Setpoints(*(column[chosen] for column in self))


def spread(values: Array) -> Spread | None:
    """Return the spread of the values that are not NaN; None without any."""
    known = values[~np.isnan(values)]
    if not len(known):
        return None
    p50, p95 = np.percentile(known, (50, 95))
    return Spread(float(p50), float(p95), float(known.max()))


def largest_step(flown: Setpoints) -> float:
    """Return the largest distance (m) of a set-point from where the one before leads.

    That is p + v Δt + ½ a Δt².
    """
    if len(flown.clock) < 2:
        return 0.0
    dt = np.diff(flown.clock)[:, None]
    led = flown.places[:-1] + flown.velocities[:-1] * dt + 0.5 * flown.accelerations[:-1] * dt**2
    steps = np.linalg.norm(flown.places[1:] - led, axis=1)
    return float(steps[dt[:, 0] <= TOGETHER].max(initial=0.0))


def tracking_errors(flown: Setpoints, track: Track) -> Array:
    """Return the distances (n,) of the vehicle from its set-points; NaN where its position is unknown."""
    off: Array = np.linalg.norm(track.at(flown.times) - flown.places, axis=1)
    return off


def surface_errors(
    tracks: Mapping[int, Track],
    target: Callable[[Array], Array],
    nearest: Callable[[Array], Array],
    times: Array,
) -> Array:
    """Return the distances (n, K) of K vehicles at ``times`` (n,) from the surface around the target.

    ``nearest`` maps offsets (…, 3) from the target to the nearest points of the surface. NaN where a
    vehicle's position is unknown.
    """
    around = target(times)
    columns = []
    for track in tracks.values():
        offset = track.at(times) - around
        known = ~np.isnan(offset).any(axis=1)
        column = np.full(len(times), np.nan)
        column[known] = np.linalg.norm(offset[known] - nearest(offset[known]), axis=1)
        columns.append(column)
    return np.stack(columns, axis=1)


def looks(begin: float, end: float) -> Array:
    """Return sample times from ``begin`` to ``end`` (s)."""
    return np.arange(begin, end, _STEP)


def converged_after(errors: Array, times: Array) -> float | None:
    """Return the time (s) from the first of ``times`` (n,) until all vehicles have converged.

    They have when all of ``errors`` (n, K) stay below ``NEAR`` for ``HELD``; the beginning of that interval
    counts. None if they never have.
    """
    well = np.all(errors < NEAR, axis=1)
    begun: float | None = None
    for now, good in zip(times.tolist(), well.tolist(), strict=True):
        if not good:
            begun = None
        elif begun is None:
            begun = now
        if begun is not None and now - begun >= HELD:
            return begun - float(times[0])
    return None


def joined(parts: Sequence[Array]) -> Array:
    """Return the arrays joined end to end; empty without any."""
    return np.concatenate(parts) if parts else np.empty(0)
