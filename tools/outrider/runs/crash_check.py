"""Crash check of a flight; a flight with a crash does not count as finished."""

from __future__ import annotations

import numpy as np

from outrider.runs.outcome import Outcome

_CRASH_HEIGHT = 0.2
"""m above the ground; a vehicle that was above twice this height and is below it has come down."""
_MAX_TILT = np.pi / 2.0
"""Tilt (rad) above which a vehicle has turned over."""


def first_fall(flight: Outcome) -> str | None:
    """Return a description of the first vehicle that turned over or came down; None without one.

    The check covers the time from the goal event to the end of the clock.
    """
    if flight.clock_start is None:
        return None
    samples = flight.truth.samples(flight.clock_start, flight.clock_end)
    height = samples.position[..., 2]
    flew = np.maximum.accumulate(height, axis=0) > 2.0 * _CRASH_HEIGHT if len(height) else height > 0.0
    fallen = (samples.tilt > _MAX_TILT) | (flew & (height < _CRASH_HEIGHT))
    if not fallen.any():
        return None
    first = int(np.flatnonzero(fallen.any(axis=1))[0])
    k = int(np.flatnonzero(fallen[first])[0])
    seconds = (samples.time[first] - flight.clock_start) * 1e-6
    tilt = np.degrees(samples.tilt[first, k])
    what = "turned over" if samples.tilt[first, k] > _MAX_TILT else "came down"
    return (
        f"vehicle {flight.systems[k]} {what} {seconds:.1f} s after the goal event "
        f"(tilt {tilt:.0f} deg, {height[first, k]:.1f} m above the ground)"
    )
