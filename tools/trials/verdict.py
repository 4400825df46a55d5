"""What came of a trial: figures, and what is wrong with it."""

from __future__ import annotations

from typing import Any

from trials.plan import TARGET
from trials.stage import Stage
from trials.story import ENDED, KILLED

_SAID = ("Target lost", "Target is back")
"""By every companion, to the ground."""


def verdict(stage: Stage, trouble: str | None) -> dict[str, Any]:
    """One JSON object; ``faults`` is empty for a trial that was passed. After the stage has been closed."""
    settings = stage.plan.settings()["companion"]
    d_min, target_d_min = settings["field"]["d_min"], settings["target_d_min"]
    faults = [] if trouble is None else [trouble]
    found, gap = stage.nearest() if stage.observer.ready else ([], 0.0)
    mates = [one for one in found if TARGET not in one.pair]
    guarded = [one for one in found if TARGET in one.pair]
    for one in found:
        limit = target_d_min if TARGET in one.pair else d_min
        if one.distance < limit:
            who = " and ".join("the target" if system == TARGET else str(system) for system in one.pair)
            faults.append(f"{who} are {one.distance:.2f} m apart at {one.at:.1f} s; allowed: {limit} m")
    summaries = {system: wingman.summary for system, wingman in stage.wingmen.items()}
    if trouble is None:
        for system, said in summaries.items():
            faults += _wrong_with(system, said)
            heard = stage.station.texts[system]
            wanted = _SAID if system == ENDED else (*_SAID, f"Neighbour {ENDED} is not heard")
            faults += [f"{system} did not tell the ground {text!r}" for text in wanted if text not in heard]
    sums = [said for said in summaries.values() if said is not None]
    return {
        "flavour": stage.plan.flavour,
        "speed": stage.plan.speed,
        "faults": faults,
        "least_separation_m": _least(mates),
        "least_target_m": _least(guarded),
        "d_min_m": d_min,
        "target_d_min_m": target_d_min,
        "longest_gap_s": round(gap, 3),
        "events": {str(system): len(wingman.events) for system, wingman in stage.wingmen.items()},
        "texts": {str(system): len(texts) for system, texts in stage.station.texts.items()},
        "setpoints": sum(said.get("setpoints", {}).get("count", 0) for said in sums),
        "plan_ms": {
            name: max((said.get("plan_ms", {}).get(name, 0.0) for said in sums), default=0.0)
            for name in ("p50", "p99")
        },
        "deadline_misses": sum(said.get("deadline_misses", 0) for said in sums),
        "deadline_steps": sum(said.get("deadline_steps", 0) for said in sums),
        "late_concerns": sum(said["concerns"].get("Deadlines are missed", 0) for said in sums),
        "clock_steps": sum(said["clock_steps"] for said in sums),
        "held": sum(said.get("held_epochs", 0) for said in sums),
        "companions_cpu_s": round(sum(said.get("cpu_s", 0.0) for said in sums), 1),
        "sitl_cpu_s": stage.vehicles.summary.get("cpu_s"),
        "real_time_factor": stage.vehicles.summary.get("real_time_factor"),
        "simulated_s": round(stage.now, 1),
        "wall_s": round(stage.wall_s, 1),
    }


def _least(found: list[Any]) -> float | None:
    return round(min(one.distance for one in found), 3) if found else None


def _wrong_with(system: int, said: dict[str, Any] | None) -> list[str]:
    """A companion that came to its end."""
    if said is None:
        return [f"{system} said nothing in the end"]
    wrong = [f"{system}: set-points {fault}" for fault in said["setpoint_faults"]]
    if said["ended"] != "landed" or said["fault"]:
        wrong.append(f"{system} ended otherwise: {said['ended']}")
    if said["not_finite"]:
        wrong.append(f"{system}: {said['not_finite']} set-points were not finite")
    if len(said["restarts"]) != (system == KILLED):
        wrong.append(f"{system} was restarted {len(said['restarts'])} times")
    return wrong
