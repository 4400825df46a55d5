"""Results of the rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import inf, isfinite
from typing import Any

from outrider.paper.rows import Row
from outrider.sweep.runs import Ending, Run
from outrider.sweep.statistics import least, plain


@dataclass(frozen=True)
class Result:
    """Result of one row of the table.

    ``median_s`` is None if more than half of the runs did not converge; ``worst_s`` is the longest time of
    the runs that converged. ``converged``, ``stuck`` and ``failed`` count runs; ``failed`` runs have no
    usable flight.
    """

    scenario: str
    method: str
    avoidance: str
    seeds: int
    converged: int
    median_s: float | None
    worst_s: float | None
    min_separation_m: float | None
    d_min_violations: int
    stuck: int
    failed: int

    def document(self) -> dict[str, Any]:
        """Return the result as values of JSON."""
        return asdict(self)


def result_of(row: Row, runs: Sequence[Run]) -> Result:
    """Return the result of a row from its runs."""
    times = [inf if run.seconds is None else run.seconds for run in runs]
    done = [time for time in times if isfinite(time)]
    separations = [run.separation for run in runs if run.separation is not None]
    return Result(
        row.scenario,
        row.method,
        "field",
        len(runs),
        sum(run.converged is True for run in runs),
        plain(times, 0.5),
        max(done, default=None),
        least(separations),
        sum(run.violations for run in runs),
        sum(run.ending is Ending.STUCK for run in runs),
        sum(run.ending in (Ending.FAILED, Ending.FAULT, Ending.LOST) for run in runs),
    )
