"""Operator's go: the height of the climb, and the time for which the order counts."""

from __future__ import annotations


class Go:
    """Last go of the operator; ``keeps_us``: time (µs) after which it has expired.

    ``height``: height (m) of the climb above the start; None without a go.
    """

    def __init__(self, keeps_us: int) -> None:
        self.height: float | None = None
        self._keeps_us = keeps_us
        self._since: int | None = None

    def give(self, height: float) -> None:
        """Record a go for ``height`` (m); its time begins anew."""
        self.height, self._since = height, None

    def cancel(self) -> bool:
        """Cancel the go, if there is one; return whether there was one."""
        was_given = self.height is not None
        self.height = None
        return was_given

    def expired(self, now: int) -> bool:
        """Return whether a go has expired at ``now`` (µs); its time begins at the first call."""
        if self.height is None:
            return False
        self._since = now if self._since is None else self._since
        return now - self._since > self._keeps_us
