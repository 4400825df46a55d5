"""Figures of one run that ended or was lost, taken from its journal entry."""

from __future__ import annotations

from enum import Enum
from math import inf
from typing import Any, NamedTuple

from outrider.sweep.tasks import Entry


class Ending(Enum):
    """Result of a run; if several apply, the first.

    ``FAILED``: the flight failed or a vehicle fell. ``STUCK``: not converged within the time limit.
    ``FAULT``: the run raised an error. ``LOST``: its worker died or was too slow.
    """

    VIOLATION = "violation"
    FAILED = "failed"
    STUCK = "stuck"
    FAULT = "fault"
    LOST = "lost"
    FINE = "fine"


class Run(NamedTuple):
    """Figures of one run.

    ``seconds`` to converge: inf if it did not, None without a goal or a summary. ``separation``: least
    distance between vehicles, m; ``to_obstacle``: least distance from a centre to a surface, m. ``yaw`` (deg)
    and ``tracking`` (m) are the 95th percentiles of these errors. ``what`` describes the error, the loss or
    the failure.
    """

    seed: int
    ending: Ending
    converged: bool | None
    seconds: float | None
    separation: float | None
    to_obstacle: float | None
    violations: int
    yaw: float | None
    tracking: float | None
    d_min: float | None
    span: float | None
    what: str | None


def run_of(entry: Entry, *, others: bool = False) -> Run:
    """Return the figures of an entry.

    Figures that its summary does not have are None; ``violations`` is then 0. ``others``: whether the run has
    converged, and when, is decided without the vehicles whose companion ends for good (``arrival: others``).
    """
    if entry.summary is None:
        ending = Ending.LOST if entry.status == "lost" else Ending.FAULT
        nothing = (None,) * 4
        return Run(entry.seed, ending, *nothing, 0, None, None, None, None, entry.what)
    summary = entry.summary
    converged = summary.get("converged")
    seconds = _number(summary.get("convergence_time_s"))
    if others and converged is not None:
        first = _number(summary.get("others_converge_s"))
        seconds = seconds if first is None else first
        converged = seconds is not None
    violations = int(_number(summary.get("d_min_violations")) or 0)
    failure = summary.get("failure")
    ending = (
        Ending.VIOLATION
        if violations
        else Ending.FAILED
        if failure
        else Ending.STUCK
        if converged is False
        else Ending.FINE
    )
    return Run(
        entry.seed,
        ending,
        converged,
        inf if converged is False else seconds,
        _number(summary.get("min_separation_m")),
        _number(summary.get("min_obstacle_distance_m")),
        violations,
        _p95(summary.get("yaw_error_deg")),
        _p95(summary.get("tracking_error_m")),
        _number(summary.get("d_min_m")),
        _number(summary.get("span_m")),
        str(failure) if failure else None,
    )


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) else None


def _p95(value: Any) -> float | None:
    return _number(value.get("p95")) if isinstance(value, dict) else None
