"""When a node is due under a clock that does not wait: at phase + k period, whatever happens."""

from __future__ import annotations

from mavlink_bridge.clocks.node_clock import QUANTUM
from mavlink_bridge.errors import ScheduleError
from mavlink_bridge.loops.histogram import Histogram


class Deadlines:
    """The grid ``phase`` + k ``period`` (µs, whole multiples of 4; k an integer), and how well it is kept.

    Who comes late goes on with the latest deadline that has passed; those before it are skipped, so that
    being late never leads to a burst and never shifts the grid. ``misses``: steps that began more than
    ``tolerance`` (µs, one period unless told otherwise) after the deadline they waited for. Raises
    ScheduleError for a grid that is none.
    """

    def __init__(self, period: int, phase: int, tolerance: int | None = None) -> None:
        if period <= 0 or period % QUANTUM:
            raise ScheduleError(f"period = {period} µs is not a positive multiple of {QUANTUM} µs")
        if phase < 0 or phase % QUANTUM:
            raise ScheduleError(f"phase = {phase} µs is not a multiple of {QUANTUM} µs")
        self.period = period
        self.phase = phase
        self.tolerance = period if tolerance is None else tolerance
        self.misses = 0
        self.skipped = 0
        self.lateness = Histogram()

    def first(self, now: int) -> int:
        """The earliest deadline from ``now`` (µs) on."""
        return now + (self.phase - now) % self.period

    def begin(self, deadline: int, now: int, *, excused: bool = False) -> int:
        """``now`` (µs) a step begins that waited for ``deadline``; the deadline that it is the step of. One
        that is ``excused`` (it was held up on purpose) counts nowhere."""
        late = now - deadline
        passed = max(late // self.period, 0)
        if not excused:
            self.lateness.add(late)
            self.misses += late > self.tolerance
            self.skipped += passed
        return deadline + passed * self.period

    def after(self, deadline: int) -> int:
        """The deadline that follows ``deadline``."""
        return deadline + self.period
