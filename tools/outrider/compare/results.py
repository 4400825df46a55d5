"""Results of the rows of a comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import isfinite
from statistics import fmean, median
from typing import Any

from outrider.compare.comparison import Comparison, Measure, Row
from outrider.sweep.tasks import Entry


@dataclass(frozen=True)
class Result:
    """Result of one row.

    A flight ``succeeds`` if every vehicle arrives and none collides in the scene's measure. ``failed`` runs
    have no flight. Times (s) are of flights in which all vehicles arrive: ``mean_s`` over vehicles and
    flights, ``last_s`` the mean over flights of the last arrival, ``worst_s`` the longest. ``separation_m``:
    least of all flights in the scene's measure; ``obstacle_m``: least from a surface. ``plan_ms_p50``,
    ``plan_ms_p99``: medians of the flights, measured on ``processors``. ``violations``: number of times that
    two vehicles came nearer than the scenario's own d_min. ``left_tube``: number of times that a vehicle left
    the tube of its plan.
    """

    row: str
    vehicle: str
    motion: str
    seeds: int
    succeeded: int
    collided: int
    not_arrived: int
    failed: int
    mean_s: float | None
    last_s: float | None
    worst_s: float | None
    separation_m: float | None
    obstacle_m: float | None
    path_m: float | None
    acceleration2: float | None
    jerk2: float | None
    stops: float | None
    most_speed: float | None
    most_acceleration: float | None
    most_jerk: float | None
    plan_ms_p50: float | None
    plan_ms_p99: float | None
    processors: tuple[str, ...]
    held_epochs: int
    solver_failures: int
    violations: int
    left_tube: int
    delay_ms: float
    loss: float
    reaches_bar: bool | None

    @property
    def success(self) -> float:
        """Share of the flights that succeed."""
        return self.succeeded / self.seeds if self.seeds else 0.0

    def document(self) -> dict[str, Any]:
        """Return the result as values of JSON."""
        return {**asdict(self), "success": self.success}


def result_of(
    comparison: Comparison,
    row: Row,
    links: Mapping[str, Any],
    vehicle: tuple[str, str],
    entries: Sequence[Entry],
) -> Result:
    """Return the result of ``row`` from the entries of its runs.

    ``links``: those of its scenario. ``vehicle``: its name, and what moves it.
    """
    flights = [entry.summary for entry in entries if entry.summary is not None]
    measure = comparison.measure
    collided = [one for one in flights if _collisions(one, measure)]
    there = [one for one in flights if not _late(one)]
    fine = [one for one in there if not _collisions(one, measure) and not one["failure"]]
    found = Result(
        row=row.label,
        vehicle=vehicle[0],
        motion=vehicle[1],
        seeds=len(entries),
        succeeded=len(fine),
        collided=len(collided),
        not_arrived=len(flights) - len(there),
        failed=len(entries) - len(flights),
        mean_s=_mean(there, "mean_s"),
        last_s=_mean(there, "last_s"),
        worst_s=max((one["last_s"] for one in there), default=None),
        separation_m=min(_values(flights, "separation_m"), default=None),
        obstacle_m=min(_values(flights, "obstacle_m"), default=None),
        path_m=_mean(there, "path_m"),
        acceleration2=_mean(there, "acceleration2"),
        jerk2=_mean(there, "jerk2"),
        stops=_mean(there, "stops"),
        most_speed=_most(flights, "most_speed"),
        most_acceleration=_most(flights, "most_acceleration"),
        most_jerk=_most(flights, "most_jerk"),
        plan_ms_p50=_middle(flights, "plan_ms_p50"),
        plan_ms_p99=_middle(flights, "plan_ms_p99"),
        processors=tuple(sorted({one["processor"] for one in flights})),
        held_epochs=sum(one["held_epochs"] for one in flights),
        solver_failures=sum(one["solver_failures"] for one in flights),
        violations=sum(one["d_min_violations"] for one in flights),
        left_tube=sum(one["left_tube"] for one in flights),
        delay_ms=float(links["swarm"]["delay_ms"]),
        loss=float(links["swarm"]["loss"]),
        reaches_bar=None,
    )
    return replace(found, reaches_bar=_reaches(row, found))


def faults(entry: Entry, measure: Measure) -> list[str]:
    """Return what is wrong with a flight, a clause each; nothing if it succeeded and kept its own d_min."""
    flight = entry.summary
    if flight is None:
        return [" ".join((entry.what or entry.status).split())]
    found = _collisions(flight, measure) + _late(flight)
    if flight["d_min_violations"]:
        found.append(f"{flight['d_min_violations']} violations of d_min")
    return [*found, str(flight["failure"])] if flight["failure"] else found


def _collisions(flight: Mapping[str, Any], measure: Measure) -> list[str]:
    """Return a clause for each distance below which the authors count a collision."""
    pairs = (
        ("two vehicles", flight["separation_m"], measure.least),
        ("a vehicle and an obstacle", flight["obstacle_m"], measure.obstacle),
    )
    return [
        f"{what} were {apart:g} m apart; less than {least:g} m is a collision"
        for what, apart, least in pairs
        if apart is not None and least is not None and apart < least
    ]


def _late(flight: Mapping[str, Any]) -> list[str]:
    arrived, of = flight["arrived"], flight["vehicles"]
    return [f"{arrived} of {of} arrived"] if arrived < of else []


def _reaches(row: Row, found: Result) -> bool | None:
    """Return whether the result reaches the bar of its row; None without a bar."""
    if row.bar is None:
        return None
    bar = row.bar
    pairs = ((bar.mean_s, found.mean_s), (bar.last_s, found.last_s), (bar.plan_ms, found.plan_ms_p50))
    good = all(most is None or (value is not None and value <= most) for most, value in pairs)
    return good and found.success >= bar.success and not found.violations


def _values(flights: Sequence[Mapping[str, Any]], name: str) -> list[float]:
    return [float(one[name]) for one in flights if one[name] is not None and isfinite(one[name])]


def _mean(flights: Sequence[Mapping[str, Any]], name: str) -> float | None:
    values = _values(flights, name)
    return round(fmean(values), 3) if values else None


def _middle(flights: Sequence[Mapping[str, Any]], name: str) -> float | None:
    values = _values(flights, name)
    return round(median(values), 3) if values else None


def _most(flights: Sequence[Mapping[str, Any]], name: str) -> float | None:
    return max(_values(flights, name), default=None)
