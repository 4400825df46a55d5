"""Time offsets between the clocks of the logs and the flight's clock.

Each companion has a clock of its own, and a real-time run starts at an arbitrary time. A log and the flight
start within ``REACH`` of each other. ``offset`` shifts the velocity reported by the autopilot in time against
the true velocity; the shift with the best fit is the offset of the clocks.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from outrider.report.run import Array, Log, Motions, Times

REACH = 5.0
"""Largest difference (s) between the starts of log and flight."""
_COARSE, _FINE = 0.1, 0.005
_MIN_SPEED = 0.05
"""Speed (m/s) that a vehicle must have reached for a fit."""
_MAX_VELOCITIES = 3000
"""Half of the bound on the number of velocities in a fit; the velocities of a longer log are thinned."""


def offset(log: Log, motions: Motions) -> float:
    """Return the seconds to add to a time of ``log`` to get seconds after the goal event.

    Times of the log count from its first record. The offset is accurate to the delay between vehicle and
    companion, about 20 ms. If no fit is possible (an unknown vehicle, fewer than two velocities, or a vehicle
    that did not move), the log is assumed to begin with the first sample of ``motions``.
    """
    guess = float(motions.time[0])
    if log.owner not in motions.system or len(log.moments) < 2:
        return guess
    k = motions.system.index(log.owner)
    true = np.nan_to_num(motions.velocity[:, k])
    step = max(1, len(log.moments) // _MAX_VELOCITIES)
    sent, when = log.speeds[::step], (log.moments[::step] - log.begin) * 1e-6
    if float(np.abs(sent).max()) < _MIN_SPEED:
        return guess
    for width, grid in ((REACH, _COARSE), (_COARSE, _FINE)):
        candidates = guess + grid * np.arange(-round(width / grid), round(width / grid) + 1.0)
        guess = float(
            candidates[np.argmin([_misfit(when + c, sent, motions.time, true) for c in candidates])]
        )
    return guess


def errors(logs: Sequence[Log], offsets: dict[int, float]) -> dict[int, float]:
    """Return by how many seconds each companion's clock is ahead of the fleet's median clock, by owner.

    ``offsets``: see ``offset``.
    """
    begun = {log.owner: log.begin * 1e-6 - offsets[log.owner] for log in logs if log.owner in offsets}
    middle = float(np.median(list(begun.values()))) if begun else 0.0
    return {owner: own - middle for owner, own in begun.items()}


def _misfit(when: Array, sent: Array, time: Array, true: Array) -> float:
    """Return the mean square difference (m²/s²) of reported and true velocity.

    Outside the flight the true velocity is zero.
    """
    between = np.array([np.interp(when, time, true[:, axis], 0.0, 0.0) for axis in range(3)]).T
    return float(np.mean((sent - between) ** 2))


def seconds(log: Log, times: Times | Sequence[int], ahead: float) -> Array:
    """Convert ``times`` (n,) µs of ``log`` to s after the goal event; ``ahead`` is the log's ``offset``."""
    since = np.asarray(times, dtype=np.int64) - log.begin
    return since.astype(np.float64) * 1e-6 + ahead
