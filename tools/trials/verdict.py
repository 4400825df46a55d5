"""Verdict on a trial: figures and faults."""

from __future__ import annotations

from typing import Any

from companion.config import CompanionConfig
from trials.mishaps import ENDED, KILLED
from trials.plan import MISHAPS, SORTIE, TARGET
from trials.score import Score, score
from trials.separation import Nearest, blind
from trials.stage import Stage

_SAID = ("Target lost", "Target is back")
"""Texts that every companion sends to the ground in the story of mishaps."""
Said = dict[int, dict[str, Any] | None]
"""Summaries of the companions, by system id."""


def verdict(stage: Stage, trouble: str | None) -> dict[str, Any]:
    """Return the verdict as one JSON object; ``faults`` is empty for a trial that was passed.

    ``trouble``: why the story broke off, None if it did not. The stage must have been closed.
    """
    plan = stage.plan
    config = CompanionConfig.model_validate(plan.settings(plan.flavour_of(1))["companion"])
    d_min, target_d_min = config.field.d_min, config.target_d_min
    faults = [] if trouble is None else [trouble]
    found, gap = stage.nearest() if stage.observer.ready else ([], 0.0)
    mates = [one for one in found if TARGET not in one.pair]
    guarded = [one for one in found if TARGET in one.pair]
    faults += _near(found, d_min, target_d_min) + blind(gap)
    summaries: Said = {system: companion.summary for system, companion in stage.companions.items()}
    if trouble is None:
        killed = KILLED if plan.story == MISHAPS else None
        for system, said in summaries.items():
            faults += _wrong_with(system, said, restarts=int(system == killed))
        if plan.story == MISHAPS:
            faults += _unsaid(stage)
    flown = None
    if plan.story == SORTIE and stage.observer.ready:
        flown = _scored(stage, config, summaries)
        if trouble is None:
            faults += flown.faults(_least(mates))
    return {
        "flown": plan.name,
        "speed": plan.speed,
        "faults": faults,
        "closest_m": _least(mates),
        "closest": _told(mates),
        "closest_target_m": _least(guarded),
        "d_min_m": d_min,
        "target_d_min_m": target_d_min,
        **({} if flown is None else flown.document),
        "longest_gap_s": round(gap, 3),
        "marks_s": {name: round(at, 1) for name, at in stage.marks.items()},
        "concerns": {str(system): said["concerns"] for system, said in summaries.items() if said is not None},
        **_counts(stage, summaries),
    }


def _scored(stage: Stage, config: CompanionConfig, summaries: Said) -> Score:
    logs = {system: stage.flown(system) for system in stage.plan.systems}
    counts = [None if said is None else said.get("anchored_anew") for said in summaries.values()]
    anchored = None if None in counts else sum(count for count in counts if count is not None)
    return score(logs, stage.observer.tracks(), stage, config.surface.nearest, anchored)


def _counts(stage: Stage, summaries: Said) -> dict[str, Any]:
    """Return the counts and timings of all companions."""
    sums = [said for said in summaries.values() if said is not None]
    return {
        "events": {str(system): len(companion.events) for system, companion in stage.companions.items()},
        "texts": {str(system): len(texts) for system, texts in stage.station.texts.items()},
        "setpoints": sum(said.get("setpoints", {}).get("count", 0) for said in sums),
        "plan_ms": {
            name: max((said.get("plan_ms", {}).get(name, 0.0) for said in sums), default=0.0)
            for name in ("p50", "p99")
        },
        "deadline_misses": sum(said.get("deadline_misses", 0) for said in sums),
        "deadline_steps": sum(said.get("deadline_steps", 0) for said in sums),
        "lateness_ms_p99": max((said.get("lateness_ms", {}).get("p99", 0.0) for said in sums), default=0.0),
        "late_concerns": sum(said["concerns"].get("Deadlines are missed", 0) for said in sums),
        "clock_steps": sum(said["clock_steps"] for said in sums),
        "held": sum(said.get("held_epochs", 0) for said in sums),
        "companions_cpu_s": round(sum(said.get("cpu_s", 0.0) for said in sums), 1),
        "sitl_cpu_s": stage.vehicles.summary.get("cpu_s"),
        "real_time_factor": stage.vehicles.summary.get("real_time_factor"),
        "simulated_s": round(stage.ended, 1),
        "wall_s": round(stage.wall_s, 1),
    }


def _near(found: list[Nearest], d_min: float, target_d_min: float | None) -> list[str]:
    """Return a fault for each pair that was nearer than allowed."""
    return [
        f"{_pair(one)} are {one.distance:.2f} m apart at {one.at:.1f} s; allowed: {limit} m"
        for one in found
        if (limit := target_d_min if TARGET in one.pair else d_min) is not None and one.distance < limit
    ]


def _pair(one: Nearest) -> str:
    return " and ".join("the target" if system == TARGET else str(system) for system in one.pair)


def _least(found: list[Nearest]) -> float | None:
    return round(min(one.distance for one in found), 3) if found else None


def _told(found: list[Nearest]) -> str | None:
    if not found:
        return None
    least = min(found, key=lambda one: one.distance)
    return f"{_pair(least)} at {least.at:.1f} s"


def _unsaid(stage: Stage) -> list[str]:
    """Return a fault for each text on the mishaps that the ground station did not receive."""
    faults = []
    for system, received in stage.station.texts.items():
        wanted = _SAID if system == ENDED else (*_SAID, f"Neighbour {ENDED} is not heard")
        faults += [f"{system} did not tell the ground {text!r}" for text in wanted if text not in received]
    return faults


def _wrong_with(system: int, said: dict[str, Any] | None, restarts: int) -> list[str]:
    """Return the faults of a companion that has ended, from its summary."""
    if said is None:
        return [f"{system} said nothing in the end"]
    wrong = [f"{system}: set-points {fault}" for fault in said["setpoint_faults"]]
    if said["ended"] != "landed" or said["fault"]:
        wrong.append(f"{system} ended otherwise: {said['ended']}")
    if said["not_finite"]:
        wrong.append(f"{system}: {said['not_finite']} set-points were not finite")
    if len(said["restarts"]) != restarts:
        wrong.append(f"{system} was restarted {len(said['restarts'])} times")
    return wrong
