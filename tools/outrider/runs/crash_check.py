"""Crash check of a flight; a flight with a crash does not count as finished."""

from __future__ import annotations

import numpy as np

from outrider.runs.outcome import Outcome

_LOW = 0.2
"""m above the ground; a flying vehicle is always higher between the goal event and the order to land."""
_OVER = np.pi / 2.0
"""rad of tilt; beyond it a vehicle falls."""


def first_fall(flight: Outcome) -> str | None:
    """Return a sentence about the first vehicle that turned over or came down, or None.

    The check covers the time from the goal event to the end of the clock.
    """
    if flight.clock_start is None:
        return None
    samples = flight.truth.samples(flight.clock_start, flight.clock_end)
    height = samples.position[..., 2]
    flew = np.maximum.accumulate(height, axis=0) > 2.0 * _LOW if len(height) else height > 0.0
    fallen = (samples.tilt > _OVER) | (flew & (height < _LOW))
    if not fallen.any():
        return None
    first = int(np.flatnonzero(fallen.any(axis=1))[0])
    k = int(np.flatnonzero(fallen[first])[0])
    seconds = (samples.time[first] - flight.clock_start) * 1e-6
    tilt = np.degrees(samples.tilt[first, k])
    what = "turned over" if samples.tilt[first, k] > _OVER else "came down"
    return (
        f"vehicle {flight.systems[k]} {what} {seconds:.1f} s after the goal event "
        f"(tilt {tilt:.0f} deg, {height[first, k]:.1f} m above the ground)"
    )
