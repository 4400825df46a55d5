"""Results of a finished flight: all data of its summary and its figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from companion.avoidance.field.plan_log import PlanLog
from companion.planning.avoidance import Tally
from outrider.runs.ground_truth import GroundTruth
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.starts import Starts


class Messages(NamedTuple):
    """Datagrams between nodes, counted per receiver, and invalid frames."""

    sent: int
    dropped: int
    bad: int


class Punctuality(NamedTuple):
    """Punctuality of the companions of a real-time run.

    For ``misses`` of ``deadlines`` no step began within 1 ms. ``p50_ms``, ``p99_ms``, ``max_ms``: lateness of
    the steps. All cover the time from boot to landing, without imposed freezes.
    """

    misses: int
    deadlines: int
    p50_ms: float
    p99_ms: float
    max_ms: float


@dataclass(frozen=True)
class Outcome:
    """A finished flight; times in µs on the clock of the run, None for events that did not occur.

    ``clock_start``: goal event, from which the time of the flight counts ("the clock"); ``clock_end``: end of
    this time, before the landing. ``converged_at``: start of the convergence. ``others_converged_at``:
    the same without the vehicles whose companion ends for good. ``able_converged_at``: the same also without
    those whose goals are ``covered`` (their number), see ``CoveredGoals``. ``span`` (m): a vehicle's size
    from tip to tip. ``tallies``: for each companion its counters at ``clock_start`` and at ``clock_end``.
    ``punctuality`` is that of a real-time run; lock-step has none. ``plan_logs``: per companion, on its own
    clock. ``motion``: multirotor, or point for vehicles without physics.
    """

    scenario: Scenario
    seed: int
    span: float
    starts: Starts
    target_system: int
    truth: GroundTruth
    clock_start: int | None
    clock_end: int | None
    converged_at: int | None
    others_converged_at: int | None
    able_converged_at: int | None
    covered: int
    failure: str | None
    tallies: list[tuple[Tally, Tally]]
    messages: Messages
    punctuality: Punctuality | None = None
    plan_logs: Sequence[PlanLog] = ()
    motion: str = "multirotor"

    @property
    def systems(self) -> list[int]:
        """System ids of the vehicles."""
        return list(self.scenario.systems)
