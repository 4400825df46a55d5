"""Schedule of one node in lock-step: the ticks at which it is due, and the times that it receives."""

from __future__ import annotations

from mavlink_bridge.clocks.node_clock import NodeClock
from mavlink_bridge.errors import ScheduleError
from mavlink_bridge.node import Node


class Schedule:
    """A node's deadlines: ``phase`` + k ``period`` (µs) on its own ``clock`` (None: true time).

    The node is due at the first multiple of ``tick`` (µs, true time) at which its clock shows at least the
    deadline. Raises ScheduleError for a clock that shows a negative time at ``phase``.
    """

    __slots__ = ("_clock", "_period", "_phase", "_tick", "name", "step")

    def __init__(self, node: Node, period: int, phase: int, clock: NodeClock | None, tick: int) -> None:
        self.name, self.step = node.name, node.step
        self._period, self._phase, self._tick = period, phase, tick
        self._clock = None if clock is None else self._checked(clock, phase)

    def first(self) -> int:
        """Return the first tick (µs, true time) at which the node is due; never before ``phase``."""
        return self._phase if self._clock is None else self.after(self._phase - 1)

    def after(self, true: int) -> int:
        """Return the tick (µs, true time) of the first deadline that the clock does not show yet at ``true``.

        Without a clock, ``true`` must be a tick at which the node is due.
        """
        if self._clock is None:
            return true + self._period
        shown = self._clock.reading(true)
        instant = self._clock.instant(shown + self._period - (shown - self._phase) % self._period)
        return instant + -instant % self._tick

    def told(self, true: int) -> int:
        """Return the time (µs) that the node receives when it is stepped at ``true``.

        It is later than the time of the previous step, because a deadline lies between them.
        """
        return true if self._clock is None else self._clock.local(true)

    def _checked(self, clock: NodeClock, true: int) -> NodeClock:
        shown = clock.local(true)
        if shown < 0:
            raise ScheduleError(
                f"{self.name}: its clock shows {shown} µs at {true} µs; a node needs a time of 0 µs or more"
            )
        return clock
