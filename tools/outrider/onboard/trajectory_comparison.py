"""Comparison of a shadow run's set-points with the recorded flight.

A shadow companion plans from the vehicle's recorded position. So its set-points must be near that position
and in the same frame. The set-points' velocities must also agree with their positions.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from outrider.shadow.setpoints import TOGETHER, Array, Course, course
from outrider.shadow.shadow_run import ShadowRun

_MAX_POSITION_AGE_US: Final = 500_000
"""Maximum age of a position (µs); an older one is not compared."""
_MAX_LEAD_S: Final = 0.05
"""Maximum lead of a set-point over the newest position (s): look-ahead, delay and one step."""
_WINDOW_US: Final = 1_000_000
BESIDE, ASTRAY = 0.5, 1.0
"""Limits (m) of the percentiles ``beside`` and ``astray``: estimates are wrong by decimetres, and late.

In a recorded PX4 log, position and integrated velocity of the estimator diverged by 0.5 m in a second.
"""


class TrajectoryComparison(NamedTuple):
    """Result of the comparison; None where there is nothing to measure.

    ``beside``: distance (m) of set-points from the vehicle's newest position, less the motion at the
    set-point's speed during the position's age plus 0.05 s, 99th percentile. ``astray``: deviation (m) of the
    set-points' velocities, integrated over one second, from their change of position, 95th percentile.
    """

    beside: float | None
    astray: float | None

    @property
    def faults(self) -> list[str]:
        """Faults found, as text."""
        found = []
        if self.beside is not None and self.beside > BESIDE:
            found.append(f"{self.beside:.2f} m beside the vehicle; another frame, or another time")
        if self.astray is not None and self.astray > ASTRAY:
            found.append(f"velocities that lead {self.astray:.2f} m a second from where the positions do")
        return found


def comparison(found: ShadowRun) -> TrajectoryComparison:
    """Compare the set-points that would have been sent with the vehicle's own positions."""
    of = course(found.would)
    return TrajectoryComparison(_quantile(_beside(of, found), 99), _quantile(_astray(of), 95))


def _beside(of: Course, found: ShadowRun) -> Array:
    if not found.places or not len(of.times):
        return np.zeros(0)
    times = np.array([time for time, _ in found.places])
    places = np.array([place for _, place in found.places])
    newest = np.searchsorted(times, of.times, side="right") - 1
    age = of.times - times[newest]
    known = (newest >= 0) & (age <= _MAX_POSITION_AGE_US)
    off = np.linalg.norm(of.positions - places[newest], axis=1)
    moved = np.linalg.norm(of.velocities, axis=1) * (age * 1e-6 + _MAX_LEAD_S)
    result: Array = np.maximum(off - moved, 0.0)[known]
    return result


def _astray(of: Course) -> Array:
    """Return the deviation (m) over each second without a gap."""
    if len(of.times) < 2:
        return np.zeros(0)
    spans = np.diff(of.times)
    way = np.cumsum(0.5 * (of.velocities[1:] + of.velocities[:-1]) * (spans * 1e-6)[:, None], axis=0)
    way = np.vstack((np.zeros(3), way))
    gaps = np.concatenate(([0], np.cumsum(spans > TOGETHER)))
    end = np.searchsorted(of.times, of.times + _WINDOW_US)
    begin = np.flatnonzero(end < len(of.times))
    end = end[begin]
    begin, end = begin[gaps[begin] == gaps[end]], end[gaps[begin] == gaps[end]]
    led = way[end] - way[begin]
    result: Array = np.linalg.norm(led - (of.positions[end] - of.positions[begin]), axis=1)
    return result


def _quantile(values: Array, percent: float) -> float | None:
    known = values[np.isfinite(values)]
    return round(float(np.percentile(known, percent)), 3) if len(known) else None
