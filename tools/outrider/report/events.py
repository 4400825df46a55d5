"""Events of a run, from the configuration, the summary, the true motions and the logs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from outrider.report.clocks import seconds
from outrider.report.distances import Encounter
from outrider.report.log_events import sayings
from outrider.report.run import Log, Run
from outrider.scenarios.faults import FromStart, description
from outrider.scenarios.places import FixedTarget
from outrider.scenarios.scenario import Scenario

TOGETHER = 0.5
"""Time (s) within which equal events of several vehicles are merged."""
_MAX_LOOKBACK = 64
"""Number of earlier events searched for an equal one."""


class Event(NamedTuple):
    """Event at ``time`` s after the goal event, until ``until`` if it lasts.

    ``who`` has system ids, none for all vehicles; ``bad`` marks an event that needs attention.
    """

    time: float
    kind: str
    who: tuple[int, ...]
    text: str
    until: float | None = None
    bad: bool = False


def events(run: Run, near: Sequence[Encounter], offsets: dict[int, float], end: float) -> list[Event]:
    """Return all events of a run, in order of time.

    Events of the scenario after ``end`` (s after the goal event) are omitted. ``offsets`` are the offsets of
    the logs' clocks by owner; a log without an offset is omitted.
    """
    found = [*_goal(run), *_encounters(near)]
    if run.scenario is not None:
        found += [event for event in _scenario(run.scenario) if event.time <= end]
    for log in run.logs:
        if log.owner in offsets:
            found += _sent(log, offsets[log.owner])
    return together(sorted(found, key=lambda event: (event.time, event.kind, event.who)))


def together(found: Sequence[Event]) -> list[Event]:
    """Merge equal events of several vehicles within ``TOGETHER`` s; ``found`` is in order of time."""
    merged: list[Event] = []
    for event in found:
        place = len(merged) - 1
        while place >= max(0, len(merged) - _MAX_LOOKBACK) and event.time - merged[place].time <= TOGETHER:
            other = merged[place]
            alike = (other.kind, other.text, other.until, other.bad) == event[1:2] + event[3:]
            if alike and not set(other.who) & set(event.who):
                merged[place] = other._replace(who=tuple(sorted(other.who + event.who)))
                break
            place -= 1
        else:
            merged.append(event)
    return merged


def _goal(run: Run) -> Iterator[Event]:
    has_goal = run.summary.get("converged") is not None
    if run.scenario is not None:
        has_goal = run.scenario.has_goal
    if run.motions is None or run.motions.time[-1] >= 0.0:
        yield Event(0.0, "goal", (), "the goal event" if has_goal else "the clock starts")
    converged = run.summary.get("convergence_time_s")
    if isinstance(converged, int | float):
        yield Event(float(converged), "converged", (), "all vehicles are in place, and stay")


def _encounters(near: Sequence[Encounter]) -> Iterator[Event]:
    for one in near:
        first, second = one.who
        who = (first, second) if isinstance(second, int) else (first,)
        whom = second if isinstance(second, str) else "each other"
        text = f"{one.least:.2f} m from {whom} at {one.time:.2f} s, nearer than {one.limit:g} m"
        yield Event(one.begin, "too near", who, text, one.end, bad=True)


def _scenario(scenario: Scenario) -> Iterator[Event]:
    """Yield the events that the scenario's file defines, except clock faults, which last the whole flight."""
    for fault in scenario.faults:
        if not isinstance(fault, FromStart):
            until = getattr(fault, "for_s", None)
            end = None if until is None else fault.at_s + until
            yield Event(fault.at_s, "fault", (fault.vehicle,), description(fault), end, bad=True)
    for cut in scenario.partitions:
        text = f"the swarm link is cut around {', '.join(map(str, cut.members))}"
        yield Event(cut.at_s, "partition", cut.members, text, cut.at_s + cut.for_s, bad=True)
    for gust in scenario.weather.gusts:
        text = "a gust of {:g}, {:g}, {:g} m/s east, north, up".format(*gust.velocity)
        yield Event(gust.at_s, "gust", (), text, gust.at_s + gust.length_s)
    if isinstance(scenario.target, FixedTarget):
        for jump in scenario.target.jumps:
            yield Event(jump.after_s, "target", (), "the target jumps to {:g}, {:g}, {:g} m".format(*jump.to))
    for system, other in zip(scenario.systems[scenario.vehicles :], scenario.bystanders, strict=True):
        if other.goal is not None:
            yield Event(other.after_s, "bystander", (system,), "sets out, and gives way to nobody")


def _sent(log: Log, ahead: float) -> Iterator[Event]:
    for saying in sayings(log):
        (time,) = seconds(log, [saying.time], ahead).tolist()
        yield Event(time, saying.kind, (log.owner,), saying.text, bad=saying.bad)
