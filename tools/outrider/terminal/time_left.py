"""Estimate of the time that is left of long work, from the share that is done."""

from __future__ import annotations

import time
from collections.abc import Callable

_LEAST_S, _LEAST_SHARE = 2.0, 1e-3
"""Wall time and share of the work after which an estimate is made."""


class TimeLeft:
    """Estimate at the pace since the first report; ``clock`` gives seconds."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._first: tuple[float, float] | None = None
        self._last = 0.0

    def seconds(self, share: float) -> float | None:
        """Return the seconds left when ``share`` (0…1) is done; None while it is too early to tell."""
        now = self._clock()
        if self._first is None or share < self._last:
            # Other work has begun.
            self._first = now, share
        self._last = share
        began, before = self._first
        if now - began < _LEAST_S or share - before < _LEAST_SHARE:
            return None
        return (1.0 - min(share, 1.0)) * (now - began) / (share - before)

    def words(self, share: float) -> str:
        """Return ``about 3 min left``, or an empty string while it is too early to tell."""
        left = self.seconds(share)
        return "" if left is None else f"about {duration(left)} left"


def duration(seconds: float) -> str:
    """Return a duration as a person says it: 40 s, 3 min, 2 h 10 min."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"
