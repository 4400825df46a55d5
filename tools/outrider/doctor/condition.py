"""Something that is so or not, over time."""

from __future__ import annotations

from typing import Final

_BRIEF: Final = 1.0
"""s that are not worth a word."""


class Condition:
    """``holds``: whether it is so, None if nobody said; ``lost``: how often it was so and then was not."""

    def __init__(self) -> None:
        self.holds: bool | None = None
        self.lost = 0
        self._since = self._missing = 0

    def tell(self, now: int, holds: bool) -> None:
        """What is said at ``now`` (µs)."""
        if self.holds is False:
            self._missing += max(now - self._since, 0)
        self.lost += self.holds is True and not holds
        self.holds, self._since = holds, now

    @property
    def history(self) -> str:
        """A sentence on what was not so before; empty if all was well."""
        if self.missing < _BRIEF:
            return ""
        times = f", and it was lost {self.lost} times" if self.lost > 1 else ", and it was lost once"
        return f" For {self.missing:.0f} s it was not so{times if self.lost else ', to begin with'}."

    @property
    def missing(self) -> float:
        """For how long it was said not to be so, s."""
        return self._missing * 1e-6
