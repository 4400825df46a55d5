"""When the records of a log were on the flight's clock: each companion lives by a clock of its own, and a
run in real time begins at any hour.

Log and flight begin together, within a second or so. From there on the velocity that the autopilot told is
laid over the true one, and where it fits best is how far apart the clocks are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from outrider.report.run import Array, Log, Motions, Times

REACH = 5.0
"""s by which log and flight may begin apart."""
_COARSE, _FINE = 0.1, 0.005
_STILL = 0.05
"""m/s: who never moved faster cannot be laid over anything."""
_MOST = 3000
"""So many velocities of a log settle it."""


def offset(log: Log, motions: Motions) -> float:
    """Seconds to add to a time of ``log`` (s since its first record) to have seconds after the goal event.
    Good to the delay between vehicle and companion, some 20 ms."""
    guess = float(motions.time[0])
    if log.owner not in motions.system or len(log.moments) < 2:
        return guess
    k = motions.system.index(log.owner)
    true = np.nan_to_num(motions.velocity[:, k])
    step = max(1, len(log.moments) // _MOST)
    told, when = log.speeds[::step], (log.moments[::step] - log.begin) * 1e-6
    if float(np.abs(told).max()) < _STILL:
        return guess
    for width, grid in ((REACH, _COARSE), (_COARSE, _FINE)):
        candidates = guess + grid * np.arange(-round(width / grid), round(width / grid) + 1.0)
        guess = float(
            candidates[np.argmin([_misfit(when + c, told, motions.time, true) for c in candidates])]
        )
    return guess


def errors(logs: Sequence[Log], offsets: dict[int, float]) -> dict[int, float]:
    """By how many seconds each companion's clock is ahead of the fleet's, by the middle one of them; by
    owner. ``offsets``: see ``offset``."""
    begun = {log.owner: log.begin * 1e-6 - offsets[log.owner] for log in logs if log.owner in offsets}
    middle = float(np.median(list(begun.values()))) if begun else 0.0
    return {owner: own - middle for owner, own in begun.items()}


def _misfit(when: Array, told: Array, time: Array, true: Array) -> float:
    """Mean square (m²/s²) of told less true velocity where both are known; outside the flight is at rest."""
    between = np.array([np.interp(when, time, true[:, axis], 0.0, 0.0) for axis in range(3)]).T
    return float(np.mean((told - between) ** 2))


def seconds(log: Log, times: Times | Sequence[int], ahead: float) -> Array:
    """``times`` (n,) µs of ``log`` as s after the goal event; ``ahead`` is its ``offset``."""
    since = np.asarray(times, dtype=np.int64) - log.begin
    return since.astype(np.float64) * 1e-6 + ahead
