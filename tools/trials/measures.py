"""How well a flight was flown: figures of tracks and set-points, values only.

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
"""s: set-points that are further apart are no step but a gap."""
NEAR, HELD = 0.75, 3.0
"""m from its surface, for so many s: then a vehicle has converged."""
_STEP = 0.02
"""s between two looks."""


class Spread(NamedTuple):
    """Median, 95th percentile and largest of some values."""

    p50: float
    p95: float
    max: float


class Setpoints(NamedTuple):
    """Those of one companion: times (n,), the same by its own clock (n,), positions, velocities and
    accelerations, each (n, 3)."""

    times: Array
    clock: Array
    places: Array
    velocities: Array
    accelerations: Array

    def between(self, begin: float, end: float) -> Setpoints:
        """Those of that time."""
        chosen = (self.times >= begin) & (self.times <= end)
        return Setpoints(*(column[chosen] for column in self))


def spread(values: Array) -> Spread | None:
    """Of those that are known (not NaN); None without any."""
    known = values[~np.isnan(values)]
    if not len(known):
        return None
    p50, p95 = np.percentile(known, (50, 95))
    return Spread(float(p50), float(p95), float(known.max()))


def largest_step(flown: Setpoints) -> float:
    """How far (m) a set-point was from where the one before led: p + v Δt + ½ a Δt²."""
    if len(flown.clock) < 2:
        return 0.0
    dt = np.diff(flown.clock)[:, None]
    led = flown.places[:-1] + flown.velocities[:-1] * dt + 0.5 * flown.accelerations[:-1] * dt**2
    steps = np.linalg.norm(flown.places[1:] - led, axis=1)
    return float(steps[dt[:, 0] <= TOGETHER].max(initial=0.0))


def tracking_errors(flown: Setpoints, track: Track) -> Array:
    """Distances (n,) of the vehicle from its set-points; NaN where it is not known."""
    off: Array = np.linalg.norm(track.at(flown.times) - flown.places, axis=1)
    return off


def surface_errors(
    tracks: Mapping[int, Track],
    target: Callable[[Array], Array],
    nearest: Callable[[Array], Array],
    times: Array,
) -> Array:
    """Distances (n, K) at ``times`` (n,) from the surface around the target, whose ``nearest`` point to an
    offset (…, 3) from it is asked for; NaN where a vehicle is not known."""
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
    """Times from ``begin`` to ``end``, close enough together for figures."""
    return np.arange(begin, end, _STEP)


def converged_after(errors: Array, times: Array) -> float | None:
    """s from the first of ``times`` (n,) until all of ``errors`` (n, K) begin to be below ``NEAR`` for
    ``HELD``; None if they never are."""
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
    """One after the other; empty without any."""
    return np.concatenate(parts) if parts else np.empty(0)
