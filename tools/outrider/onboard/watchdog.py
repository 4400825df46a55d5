"""Watchdog of another process, by the time of its last message."""

from __future__ import annotations

from typing import Final

FIRST: Final = 10.0
"""Time limit for the first message of a process (s): on a busy machine it starts slowly."""
HUNG: Final = 2.0
"""Time after a message (s); a process that sends no other one within it counts as hung."""
_MAX_POLL_INTERVAL_S: Final = 0.5


class Watchdog:
    """Watchdog of a process that was started at ``now`` (s).

    ``hung``: as ``HUNG``. A late poll restarts the time-out: what delayed the caller may have delayed the
    other process as well.
    """

    def __init__(self, now: float, hung: float = HUNG) -> None:
        self._since = self._looked = now
        self._limit, self._hung = FIRST, hung

    def received(self, now: float) -> None:
        """Restart the time-out: a message arrived."""
        self._since, self._limit = now, self._hung

    def stopped(self, now: float) -> bool:
        """Return whether the process has been silent for too long; to be polled at least every 0.5 s."""
        if now - self._looked > _MAX_POLL_INTERVAL_S:
            self._since = now
        self._looked = now
        return now - self._since > self._limit
