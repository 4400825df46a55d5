"""Headline of the report: the outcome in words, and key figures."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from outrider.report.run import Run


class Fact(NamedTuple):
    """Key figure: its name, its value, and a value to compare it with."""

    what: str
    value: str
    against: str = ""


class Headline(NamedTuple):
    """Headline: ``verdict`` is good, bad or open (not known), ``outcome`` is a sentence."""

    verdict: str
    outcome: str
    facts: tuple[Fact, ...]


def headline(run: Run, lost: float | None) -> Headline:
    """Return the headline of a run.

    Without a summary the outcome is not known. ``lost`` is the share (0…1) of the swarm link's messages that
    were lost, or None if it is not known.
    """
    facts = tuple(_facts(run.summary, lost))
    return Headline(*_outcome(run), facts)


def _outcome(run: Run) -> tuple[str, str]:
    """Return the verdict and the sentence."""
    summary = run.summary
    if not summary:
        return "open", "How it ended is not known: there is no summary"
    failure, violations = summary.get("failure"), _number(summary.get("d_min_violations")) or 0.0
    converged, seconds = summary.get("converged"), summary.get("convergence_time_s")
    others = _number(summary.get("others_converge_s"))
    if converged:
        reached = f"converged in {seconds} s"
    elif others is not None:
        reached = f"not converged; those whose companion did not end, in {others:g} s"
    else:
        reached = f"not converged {_within(run)}"
    if failure:
        return "bad", f"Failed: {failure}"
    if violations:
        said = "One violation of d_min" if violations == 1 else f"{violations:g} violations of d_min"
        return "bad", said if converged is None else f"{said}; {reached}"
    if converged is False:
        return "bad", f"Stuck: {reached}"
    return "good", "Flown to the end" if converged is None else reached.capitalize()


def _within(run: Run) -> str:
    return f"in {run.scenario.duration_s:g} s" if run.scenario is not None else "by the cap"


def _facts(summary: dict[str, object], lost: float | None) -> Iterator[Fact]:
    """Yield the key figures that are available."""
    vehicles = _number(summary.get("vehicles"))
    if vehicles is not None:
        points = summary.get("motion") == "point"
        what = "points, without physics" if points else str(summary.get("sensors") or "")
        yield Fact("vehicles", f"{vehicles:g}", what)
    for key, what, limit, name in _NEAR:
        least, against = _number(summary.get(key)), _number(summary.get(limit))
        if least is not None:
            yield Fact(what, f"{least:.2f} m", "" if against is None else f"{name} {against:g} m")
    for key, what, unit in _SPREAD:
        values = summary.get(key)
        middle = _number(values.get("p50")) if isinstance(values, dict) else None
        if isinstance(values, dict) and middle is not None:
            high = next((name for name in ("p99", "p95") if _number(values.get(name)) is not None), None)
            yield Fact(
                what, f"{middle:.2f} {unit}", "" if high is None else f"{high} {values[high]:.2f} {unit}"
            )
    if lost is not None:
        yield Fact("messages lost", f"{100.0 * lost:.1f} %", "swarm link")
    misses, steps = _number(summary.get("deadline_misses")), _number(summary.get("deadline_steps"))
    if misses is not None and steps is not None:
        yield Fact("deadlines missed", f"{misses:g}", f"of {steps:g}")


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


_NEAR = (
    ("min_separation_m", "least separation", "d_min_m", "d_min"),
    ("min_target_distance_m", "least to the target", "d_min_target_m", "d_min"),
    ("min_obstacle_distance_m", "least to an obstacle", "d_min_obstacle_m", "d_min"),
)
_SPREAD = (
    ("standoff_error_m", "stand-off error", "m"),
    ("yaw_error_deg", "yaw error", "°"),
    ("plan_ms", "CPU time of a plan", "ms"),
)
