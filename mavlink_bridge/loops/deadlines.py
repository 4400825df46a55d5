"""Deadlines of a node under a wall clock: at phase + k period, regardless of delays."""

from __future__ import annotations

from mavlink_bridge.clocks.node_clock import QUANTUM
from mavlink_bridge.errors import ScheduleError
from mavlink_bridge.loops.histogram import Histogram


class Deadlines:
    """The grid ``phase`` + k ``period`` (µs, multiples of 4; k an integer), and the lateness of the steps.

    After a late step the node continues with the latest deadline that has passed; earlier ones are skipped.
    Lateness therefore never causes a burst and never shifts the grid. ``misses`` counts steps that began more
    than ``tolerance`` (µs, default one period) after the deadline they waited for; ``skipped`` counts
    deadlines without a step. Raises ScheduleError for an invalid period or phase.
    """

    def __init__(self, period: int, phase: int, tolerance: int | None = None) -> None:
        if period <= 0 or period % QUANTUM:
            raise ScheduleError(f"period = {period} µs is not a positive multiple of {QUANTUM} µs")
        if phase < 0 or phase % QUANTUM:
            raise ScheduleError(f"phase = {phase} µs is not 0 or a positive multiple of {QUANTUM} µs")
        self.period = period
        self.phase = phase
        self.tolerance = period if tolerance is None else tolerance
        self.misses = 0
        self.skipped = 0
        self.lateness = Histogram()

    def first(self, now: int) -> int:
        """Return the earliest deadline at or after ``now`` (µs)."""
        return now + (self.phase - now) % self.period

    def begin(self, deadline: int, now: int, *, excused: bool = False) -> int:
        """Record the beginning of a step at ``now`` (µs), which waited for ``deadline``.

        Returns the deadline that the step serves: the latest one not after ``now``. An ``excused`` step (one
        that was delayed on purpose) does not enter the statistics.
        """
        late = now - deadline
        passed = max(late // self.period, 0)
        if not excused:
            self.lateness.add(late)
            self.misses += late > self.tolerance
            self.skipped += passed
        return deadline + passed * self.period

    def after(self, deadline: int) -> int:
        """Return the deadline that follows ``deadline``."""
        return deadline + self.period
