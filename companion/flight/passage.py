"""Passage between two modes of an autopilot: a change to a third mode is another controller's."""

from __future__ import annotations


class Passage:
    """Checks that the modes during take-off or landing result from the companion's own order.

    Any other mode was set by another controller. ``first``: custom_mode of HEARTBEAT at the time of the
    order, which the vehicle keeps until the order takes effect.
    """

    def __init__(self, first: int) -> None:
        self._first = first
        self.entered = False
        """Whether the order has taken effect."""

    def strays(self, mode: int, ways: frozenset[int], before: frozenset[int] = frozenset()) -> bool:
        """Return whether ``mode`` does not result from the own order.

        Modes in ``ways`` result from it. Until one of these has been seen, the first mode and those in
        ``before`` are permitted, too.
        """
        if mode in ways:
            self.entered = True
            return False
        return self.entered or (mode != self._first and mode not in before)
