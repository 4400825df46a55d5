"""History of a condition that is true or false over time."""

from __future__ import annotations

from typing import Final

_MIN_REPORTED_S: Final = 1.0
"""Shortest time worth reporting (s)."""


class Condition:
    """Durations and changes of a condition.

    ``holds``: its latest value, None before the first; ``lost``: number of times it was true and then became
    false.
    """

    def __init__(self) -> None:
        self.holds: bool | None = None
        self.lost = 0
        self._since = self._missing = 0

    def tell(self, now: int, holds: bool) -> None:
        """Add the value at ``now`` (µs)."""
        if self.holds is False:
            self._missing += max(now - self._since, 0)
        self.lost += self.holds is True and not holds
        self.holds, self._since = holds, now

    @property
    def history(self) -> str:
        """Sentence on the time for which the condition was false; empty if less than 1 s."""
        if self.missing < _MIN_REPORTED_S:
            return ""
        times = f", and it was lost {self.lost} times" if self.lost > 1 else ", and it was lost once"
        return f" For {self.missing:.0f} s it was not so{times if self.lost else ', to begin with'}."

    @property
    def missing(self) -> float:
        """Time for which the condition was reported false (s)."""
        return self._missing * 1e-6
