"""Meanings of the keys of a summary, for its table."""

from __future__ import annotations

from typing import NamedTuple


class Term(NamedTuple):
    """Name in words, unit and meaning of a key."""

    words: str
    unit: str
    meaning: str


TERMS = {
    "scenario": Term("scenario", "", ""),
    "method": Term("method", "", "the way out of the field's local minima"),
    "avoidance": Term("avoidance", "", "field: the paper's; certified: plans with proven separation"),
    "planar": Term("planar", "", "whether heights were fixed"),
    "turning_sense": Term("turning sense", "", "own: each by its own approach; right, left: one for all"),
    "seed": Term("seed", "", "of starts, noise, clocks and link faults"),
    "vehicles": Term("vehicles", "", "with bystanders"),
    "sensors": Term("sensors", "", "sensor profile of the autopilots"),
    "converged": Term("converged", "", "all vehicles in place, and slow, for one second"),
    "convergence_time_s": Term("time to converge", "s", "start of that second, after the goal event"),
    "others_converge_s": Term(
        "others converge",
        "s",
        "the same without the vehicles whose companion ends for good, or beside a goal that is covered",
    ),
    "covered_goals": Term(
        "covered goals", "", "of the others, nearer than the least distance to where such a vehicle rests"
    ),
    "uncovered_converge_s": Term(
        "others with a free goal converge", "s", "the same also without the vehicles with covered goals"
    ),
    "failure": Term("failure", "", "reason why the flight failed, or vehicles that fell or did not land"),
    "min_separation_m": Term(
        "least separation", "m", "of two vehicles' centres, true, at every physics step"
    ),
    "min_target_distance_m": Term("least distance to the target", "m", "where the target is an obstacle"),
    "min_obstacle_distance_m": Term("least distance to an obstacle", "m", "from a centre to a surface"),
    "d_min_m": Term("d_min", "m", "two vehicles nearer than this are a violation"),
    "downwash": Term("downwash", "", "differences in height of two vehicles count divided by this"),
    "d_min_target_m": Term("d_min to the target", "m", ""),
    "d_min_obstacle_m": Term("d_min to obstacles", "m", ""),
    "span_m": Term("vehicle, tip to tip", "m", "two level vehicles nearer than this may touch"),
    "motion": Term(
        "motion", "", "multirotor: simulated physics; point: exactly as the set-points say, no physics"
    ),
    "d_min_violations": Term("violations of d_min", "", "encounters, not samples"),
    "max_speed_m_s": Term("largest speed", "m/s", ""),
    "max_acceleration_m_s2": Term("largest acceleration", "m/s²", ""),
    "max_tilt_deg": Term("largest tilt", "°", ""),
    "standoff_error_m": Term("stand-off error", "m", "distance from the surface around the true target"),
    "yaw_error_deg": Term("yaw error", "°", "between the nose and the bearing of the true target"),
    "tracking_error_m": Term(
        "tracking error", "m", "between the autopilot's estimated position and its reference"
    ),
    "estimate_error_m": Term(
        "error of the estimate", "m", "between the autopilot's estimated and true position"
    ),
    "target_error_m": Term("error of the target's estimate", "m", "fused estimates against the truth"),
    "nees": Term("NEES of the target", "", "squared error over covariance; 3 on average if that is right"),
    "information_ratio": Term("information ratio", "", "tr Σ·a/2: 1 for the best bearings"),
    "anisotropy": Term("anisotropy", "", "|s|/Σw of the bearings: 0 for the best"),
    "seen_by": Term("target seen by", "", "vehicles whose detections arrive"),
    "detections": Term("detections", "", "of all companions together"),
    "plan_ms": Term("CPU time of a plan", "ms", "neighbours to plan"),
    "plans": Term("plans", "", "made while the clock ran"),
    "solver_failures": Term("solver failures", "", "the old plan is held, then the vehicle brakes"),
    "relaxed_qps": Term("relaxed QPs", "", "plans in which a state limit was relaxed"),
    "held_epochs": Term("held plans", "", "times a plan was due and the old one was kept"),
    "anchored_anew": Term("anchored anew", "", "times a plan started anew from where the vehicle was"),
    "slack_max_m": Term("largest slack", "m", ""),
    "messages": Term(
        "messages", "", "datagrams between all nodes, counted per receiver; frames without sense"
    ),
    "deadline_misses": Term("missed deadlines", "", "of a real-time run: no step began within 1 ms"),
    "deadline_steps": Term("of so many deadlines", "", ""),
    "lateness_ms": Term("lateness of steps", "ms", "how late they began"),
    "simulated_s": Term("flown", "s", "from take-off to landing"),
    "wall_s": Term("wall time", "s", ""),
    "cpu_s": Term("CPU time", "s", ""),
    "real_time_factor": Term("real-time factor", "", "simulated seconds per second of wall time"),
}
HIDDEN = frozenset({"run_dir"})
"""Keys that are not shown: the original path of the run is useless to a reader elsewhere."""
