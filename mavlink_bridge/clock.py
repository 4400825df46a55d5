"""Where *now* comes from: integer µs, simulated or real. Only the loop that runs nodes asks a clock; nodes
are told the time."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Time in integer µs that never decreases."""

    def now(self) -> int:
        """The present, µs."""
        ...

    def wait_until(self, instant: int) -> None:
        """Return when ``now() >= instant``; at once if that is past."""
        ...


class SimulatedClock:
    """Stands still until it is told to go on, then jumps."""

    def __init__(self, start: int = 0) -> None:
        self._now = start

    def now(self) -> int:
        """The instant last waited for, µs."""
        return self._now

    def wait_until(self, instant: int) -> None:
        """Jump to ``instant``; never backwards."""
        self._now = max(self._now, instant)


class WallClock:
    """Unix time in µs, read once; from then on it runs on the monotonic clock, so that no correction of the
    host's time makes it jump."""

    def __init__(self) -> None:
        self._offset = time.time_ns() - time.monotonic_ns()

    def now(self) -> int:
        """Unix time, µs."""
        return (time.monotonic_ns() + self._offset) // 1000

    def wait_until(self, instant: int) -> None:
        """Sleep until ``instant`` (Unix µs)."""
        while (left := instant - self.now()) > 0:
            time.sleep(left * 1e-6)
