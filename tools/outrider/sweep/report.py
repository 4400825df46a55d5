"""Summary of a sweep, computed from its runs.

Each cell has counts, rates, times and separations with their intervals, and its worst runs with the commands
that replay them. The summary is a function of the runs alone: it does not depend on the machine, the time or
the number of attempts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from math import inf, isfinite
from typing import Any, NamedTuple

from outrider.sweep.runs import Ending, Run
from outrider.sweep.statistics import Interval, largest, least, plain, quantile, rate

METHOD = (
    "95 % intervals: Wilson's for rates, order statistics for quantiles; a run that did not converge took "
    "longer than every run that did; rates are of the runs that ended"
)
WORST = 3
"""Number of runs of each kind that are named for each cell."""
Command = Callable[[int], str]


class Spread(NamedTuple):
    """Distribution of one figure over the runs of a cell.

    ``extreme`` is the least distance, or the largest error; ``tail`` is the 5th percentile of distances, or
    the 95th of errors.
    """

    extreme: float | None
    tail: float | None
    median: float | None


@dataclass(frozen=True)
class Named:
    """Run listed in the report: the reason, its figures, and the command that flies it again."""

    seed: int
    why: str
    convergence_time_s: float | None
    min_separation_m: float | None
    d_min_violations: int
    what: str | None
    command: str


@dataclass(frozen=True)
class CellReport:
    """Summary of a cell.

    ``violations``, ``stuck``, ``failed``, ``faults`` and ``lost`` count runs. Times in s, distances in m.
    ``yaw`` (deg) and ``tracking`` (m) are distributions of each run's 95th percentile of the error.
    """

    label: str
    key: str
    runs: int
    ended: int
    converged: int | None
    stuck: int
    violations: int
    failed: int
    faults: int
    lost: int
    d_min: float | None
    span: float | None
    converged_rate: Interval | None
    violation_rate: Interval | None
    time_median: Interval | None
    time_p95: Interval | None
    time_worst: float | None
    separation: Spread
    to_obstacle: Spread
    yaw: Spread
    tracking: Spread
    named: tuple[Named, ...]


def cell_report(label: str, key: str, runs: Sequence[Run], command: Command) -> CellReport:
    """Return the report of one cell from all its runs, in the order of seeds.

    ``command`` returns the command that replays a seed.
    """
    done = [run for run in runs if run.ending not in (Ending.LOST, Ending.FAULT)]
    with_goal = [run for run in done if run.converged is not None]
    count = {ending: sum(run.ending is ending for run in runs) for ending in Ending}
    converged = sum(run.converged is True for run in with_goal)
    times = _present(run.seconds for run in with_goal)
    return CellReport(
        label=label,
        key=key,
        runs=len(runs),
        ended=len(done),
        converged=converged if with_goal else None,
        stuck=count[Ending.STUCK],
        violations=count[Ending.VIOLATION],
        failed=count[Ending.FAILED],
        faults=count[Ending.FAULT],
        lost=count[Ending.LOST],
        d_min=next((run.d_min for run in done if run.d_min is not None), None),
        span=next((run.span for run in done if run.span is not None), None),
        converged_rate=rate(converged, len(with_goal)),
        violation_rate=rate(count[Ending.VIOLATION], len(done)),
        time_median=quantile(times, 0.5),
        time_p95=quantile(times, 0.95),
        time_worst=largest(times),
        separation=_least(run.separation for run in done),
        to_obstacle=_least(run.to_obstacle for run in done),
        yaw=_largest(run.yaw for run in done),
        tracking=_largest(run.tracking for run in done),
        named=_named(runs, command),
    )


def exit_status(cells: Iterable[CellReport]) -> int:
    """Return 0 if all runs ended well, 1 for a violation or a goal not reached, 3 for an error or a lost run.

    3 takes precedence over 1.
    """
    cells = list(cells)
    if any(cell.faults or cell.lost for cell in cells):
        return 3
    return 1 if any(cell.violations or cell.stuck or cell.failed for cell in cells) else 0


def document(name: str, first_seed: int, cells: Sequence[CellReport]) -> dict[str, Any]:
    """Return the summary for scripts: JSON values, the same for the same runs. Infinite values are null."""
    total = {
        field: sum(getattr(cell, field) for cell in cells)
        for field in ("runs", "ended", "violations", "stuck", "failed", "faults", "lost")
    }
    return {
        "sweep": name,
        "first_seed": first_seed,
        **total,
        "method": METHOD,
        "cells": [_cell_document(cell) for cell in cells],
    }


def _cell_document(cell: CellReport) -> dict[str, Any]:
    named = [asdict(one) for one in cell.named]
    return {
        "cell": cell.label,
        "key": cell.key,
        **{
            name: getattr(cell, name)
            for name in ("runs", "ended", "converged", "stuck", "violations", "failed", "faults", "lost")
        },
        "converged_rate": _interval(cell.converged_rate),
        "violation_rate": _interval(cell.violation_rate),
        "convergence_time_s": {
            "median": _interval(cell.time_median),
            "p95": _interval(cell.time_p95),
            "worst": cell.time_worst,
        },
        "min_separation_m": _spread(cell.separation, "least", "p5"),
        "min_obstacle_distance_m": _spread(cell.to_obstacle, "least", "p5"),
        "d_min_m": cell.d_min,
        "span_m": cell.span,
        "yaw_error_p95_deg": _spread(cell.yaw, "largest", "p95"),
        "tracking_error_p95_m": _spread(cell.tracking, "largest", "p95"),
        "lost_runs": [one for one in named if one["why"] in ("lost", "fault")],
        "worst": [one for one in named if one["why"] not in ("lost", "fault")],
    }


def _interval(value: Interval | None) -> dict[str, float | None] | None:
    return None if value is None else {k: _finite(v) for k, v in value._asdict().items()}


def _spread(value: Spread, extreme: str, tail: str) -> dict[str, float | None]:
    return {extreme: value.extreme, tail: value.tail, "median": value.median}


def _finite(value: float) -> float | None:
    return round(value, 6) if isfinite(value) else None


def _least(values: Iterable[float | None]) -> Spread:
    present = _present(values)
    return Spread(least(present), plain(present, 0.05), plain(present, 0.5))


def _largest(values: Iterable[float | None]) -> Spread:
    present = _present(values)
    return Spread(largest(present), plain(present, 0.95), plain(present, 0.5))


def _present(values: Iterable[float | None]) -> list[float]:
    return [value for value in values if value is not None]


def _named(runs: Sequence[Run], command: Command) -> tuple[Named, ...]:
    """Return the runs to be named: every run that raised an error or is lost, and a few of each other kind.

    The order is: violations, runs that failed or are stuck, the smallest distances, the longest times, then
    errors and lost runs. Each run occurs once; runs with the same distance are in the order of seeds.
    """

    def nearness(run: Run) -> float:
        return min((d for d in (run.separation, run.to_obstacle) if d is not None), default=inf)

    def of(*endings: Ending) -> list[Run]:
        return sorted((run for run in runs if run.ending in endings), key=nearness)

    fine = of(Ending.FINE)
    slow = sorted((run for run in fine if run.seconds is not None), key=lambda run: -(run.seconds or 0.0))
    chosen: dict[int, tuple[str, Run]] = {}
    for why, found in (
        ("violation", of(Ending.VIOLATION)[:WORST]),
        ("failed", of(Ending.FAILED)[:WORST]),
        ("stuck", of(Ending.STUCK)[:WORST]),
        ("nearest", [run for run in fine if nearness(run) < inf][:WORST]),
        ("slowest", slow[:WORST]),
        ("fault", of(Ending.FAULT)),
        ("lost", of(Ending.LOST)),
    ):
        for run in found:
            chosen.setdefault(run.seed, (why, run))
    return tuple(
        Named(
            run.seed,
            why,
            None if run.seconds is None or run.seconds == inf else run.seconds,
            run.separation,
            run.violations,
            run.what,
            command(run.seed),
        )
        for why, run in chosen.values()
    )
