"""Times that plans took, for metrics and summaries; planning does not depend on them."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence

_MAX_NS = (1 << 32) - 1


class PlanTimes:
    """Stopwatch readings of one companion.

    ``stopwatch`` gives ns; ``took`` receives the time (ns) of each plan.
    """

    def __init__(self, stopwatch: Callable[[], int], took: Callable[[int], None]) -> None:
        self.stopwatch, self._took = stopwatch, took
        self.plan_ns = array("I")
        """Reading (ns) of each attempt to plan since the last ``shed``, clipped to 4.29 s."""
        self.plan_at = array("q")
        """Time (µs) of the step that made the attempt."""

    def add(self, now: int, started: int) -> None:
        """Record the plan that was due at ``now`` (µs) and started at stopwatch reading ``started`` (ns)."""
        self.plan_at.append(now)
        spent = min(max(self.stopwatch() - started, 0), _MAX_NS)
        self.plan_ns.append(spent)
        self._took(spent)

    def shed(self) -> Sequence[int]:
        """Remove all readings and their times; return the readings ``plan_ns``."""
        taken, self.plan_ns = self.plan_ns, array("I")
        self.plan_at = array("q")
        return taken
