"""Whether another process is alive, by when it was heard last."""

from __future__ import annotations

from typing import Final

FIRST: Final = 10.0
"""s that a process may take until it is heard first: on a busy machine it only begins then."""
HUNG: Final = 2.0
"""s without news after which a process that was heard is taken for hung."""
_LATE: Final = 0.5


class Pulse:
    """Of a process that was started at ``now`` (s). Whoever looks late himself has to look again: what held
    him up has held up the other as well."""

    def __init__(self, now: float) -> None:
        self._since = self._looked = now
        self._limit = FIRST

    def heard(self, now: float) -> None:
        """Something came."""
        self._since, self._limit = now, HUNG

    def stopped(self, now: float) -> bool:
        """Whether it has been silent for too long; asked many times a second."""
        if now - self._looked > _LATE:
            self._since = now
        self._looked = now
        return now - self._since > self._limit
