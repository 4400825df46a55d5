"""Watchdog of another process, by the time of its last message."""

from __future__ import annotations

from typing import Final

FIRST: Final = 10.0
"""Time limit for the first message of a process (s): on a busy machine it only begins then."""
HUNG: Final = 2.0
"""Time without a message after which a process that was received before counts as hung (s)."""
_LATE: Final = 0.5


class Watchdog:
    """Watchdog of a process that was started at ``now`` (s).

    A late poll restarts the time-out: what delayed the caller may have delayed the other process as well.
    """

    def __init__(self, now: float) -> None:
        self._since = self._looked = now
        self._limit = FIRST

    def received(self, now: float) -> None:
        """Restart the time-out: a message arrived."""
        self._since, self._limit = now, HUNG

    def stopped(self, now: float) -> bool:
        """Return whether the process has been silent for too long; polled many times a second."""
        if now - self._looked > _LATE:
            self._since = now
        self._looked = now
        return now - self._since > self._limit
