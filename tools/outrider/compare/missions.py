"""Starts and goals of a flight, drawn at random for a seed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from outrider.compare.comparison import Measure, Missions
from outrider.compare.measures import scaled
from outrider.errors import InputError
from outrider.scenarios.streams import Stream, stream

Array = NDArray[np.float64]
_ROUNDS, _BATCH = 400, 64
"""Number of batches of candidates after which a draw begins anew, and candidates in a batch."""
_ATTEMPTS = 60
"""Number of draws, each from its own start, until there is no room."""


class Mission(NamedTuple):
    """Starts and goals (K, 3), m, ENU."""

    starts: Array
    goals: Array


def drawn(missions: Missions, measure: Measure, count: int, seed: int) -> Mission:
    """Return the mission of ``count`` vehicles that ``seed`` draws, in whole millimetres.

    Raises InputError if there is no room.
    """
    starts = _scatter(missions, measure, count, seed, Stream.SCENE_STARTS, "starts")
    goals = _scatter(missions, measure, count, seed, Stream.SCENE_GOALS, "goals", starts)
    return Mission(starts, goals)


def _scatter(
    missions: Missions,
    measure: Measure,
    count: int,
    seed: int,
    of: Stream,
    what: str,
    about: Array | None = None,
) -> Array:
    """Return ``count`` places (count, 3), m; each is ``missions.near`` one of ``about`` (count, 3), m."""
    for attempt in range(_ATTEMPTS):
        random = stream(seed, of, attempt)
        placed = np.empty((0, 3))
        for _ in range(_ROUNDS):
            found = np.round(random.uniform(missions.low, missions.high, size=(_BATCH, 3)), 3) + 0.0
            off = scaled(found[:, None] - placed[None], measure)
            fits = (off >= missions.apart).all(axis=1)
            if about is not None and missions.near is not None:
                fits &= np.linalg.norm(found - about[len(placed)], axis=1) <= missions.near
            free = np.flatnonzero(fits)
            if free.size:
                placed = np.vstack([placed, found[free[0]]])
                if len(placed) == count:
                    return placed
    sides = " × ".join(f"{high - low:g}" for low, high in zip(missions.low, missions.high, strict=True))
    raise InputError(
        f"seed {seed}: there is no room for {count} {what} {missions.apart:g} m apart in {sides} m; allowed:"
        " fewer vehicles, or less apart"
    )
