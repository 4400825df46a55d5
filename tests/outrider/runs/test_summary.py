"""The summary: the keys that scripts rely on, figures that pass over what is not there, the exit status."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from companion.planning.avoidance import Tally
from outrider.runs.ground_truth import Samples
from outrider.runs.outcome import Messages, Outcome, Punctuality
from outrider.runs.summary import (
    WALL_FIELDS,
    Cost,
    Value,
    exit_status,
    standoff_errors,
    summarise,
    write,
    yaw_errors,
)
from outrider.scenarios.scenario import Scenario
from tests.outrider.shipped import scenario

KEYS = {
    "scenario", "method", "avoidance", "planar", "turning_sense", "seed", "vehicles", "sensors",
    "converged", "convergence_time_s", "others_converge_s", "covered_goals", "uncovered_converge_s",
    "min_separation_m",
    "min_obstacle_distance_m", "d_min_m", "d_min_violations", "max_speed_m_s", "max_acceleration_m_s2",
    "max_tilt_deg", "yaw_error_deg", "standoff_error_m", "plan_ms", "plans", "solver_failures",
    "held_epochs", "slack_max_m", "tracking_error_m", "messages", "deadline_misses", "deadline_steps",
    "simulated_s", "wall_s", "cpu_s", "real_time_factor", "run_dir",
}  # fmt: skip
INNER = {
    "yaw_error_deg": {"p50", "p95"},
    "standoff_error_m": {"p50", "p95"},
    "plan_ms": {"p50", "p99", "max"},
    "tracking_error_m": {"p95", "max"},
    "messages": {"sent", "dropped", "bad"},
}
NAN = float("nan")
# Per companion, at the start of the clock and at the end.
TALLIES = ((Tally(10, 1, 2, 3, 1, (5, 5)), Tally(30, 4, 7, 8, 2, (5, 5, 1_000_000, 3_000_000))),) * 2
ANTIPODAL, JUMP, ESCORT = scenario("antipodal-8", vehicles=2), scenario("scenario-1", vehicles=2), "escort"


def hovering(count: int, vehicles: int = 2) -> Samples:
    """Still, everything zero, a sample every 20 ms."""
    flat, deep = np.zeros((count, vehicles)), np.zeros((count, vehicles, 3))
    time = np.arange(count, dtype=np.int64) * 20_000
    target, still = np.zeros((count, 3)), np.empty((count, 0, 3))
    return Samples(time, deep, deep, deep, deep, deep, flat, flat, target, np.full(count, 4.0), still)


@dataclass
class Seen:
    """Stands in for the truth of a flight."""

    all: Samples
    vehicles: Any = field(default_factory=lambda: SimpleNamespace(count=0, minimum=1.5))
    target: Any = field(default_factory=lambda: SimpleNamespace(count=0, minimum=2.5))
    obstacles: Any = field(default_factory=lambda: SimpleNamespace(count=0, minimum=float("inf")))

    def samples(self, since: int = 0, until: int | None = None) -> Samples:
        chosen = (self.all.time >= since) & (self.all.time < (until if until is not None else 1 << 62))
        return Samples(*(part[chosen] for part in self.all))


@dataclass
class Flown:
    """Stands in for a finished flight: all that a summary asks of one."""

    scenario: Scenario = ANTIPODAL
    truth: Seen = field(default_factory=lambda: Seen(hovering(50)))
    clock_start: int | None = 200_000
    clock_end: int | None = 800_000
    converged_at: int | None = 500_000
    others_converged_at: int | None = 400_000
    able_converged_at: int | None = 300_000
    covered: int = 1
    failure: str | None = None
    span: float = 0.63
    motion: str = "multirotor"
    tallies: Any = TALLIES
    seed: int = 7
    systems: tuple[int, ...] = (11, 12)
    messages: Messages = field(default_factory=lambda: Messages(100, 7, 3))
    punctuality: Punctuality | None = None


def summary(**changes: Any) -> dict[str, Value]:
    flown = cast("Outcome", Flown(**changes))
    return summarise(flown, Cost(2.0, 1.5), Path("runs/x"))


def no_constant(word: str) -> None:
    raise AssertionError(f"{word} is no JSON")


def test_every_promised_key_is_there() -> None:
    found = summary()
    assert set(found) >= KEYS
    for key, inner in INNER.items():
        value = found[key]
        assert isinstance(value, dict)
        assert set(value) == inner


def test_it_is_plain_json_also_when_nothing_was_seen(tmp_path: Path) -> None:
    nothing = Seen(hovering(0))
    nothing.vehicles.minimum = nothing.target.minimum = float("inf")
    for changes in ({}, {"truth": nothing}, {"truth": nothing, "clock_start": None, "converged_at": None}):
        found = summary(**changes)
        write(found, tmp_path / "summary.json")
        read = json.loads((tmp_path / "summary.json").read_text(), parse_constant=no_constant)
        assert read == found
        assert list(read) == list(found)
    assert found["min_separation_m"] is None
    assert found["max_speed_m_s"] is None
    assert found["yaw_error_deg"] == {"p50": None, "p95": None}


def test_counters_are_those_of_the_clock_and_failures_those_of_the_flight() -> None:
    found = summary()
    assert (found["plans"], found["held_epochs"], found["anchored_anew"]) == (40, 10, 2)
    assert found["solver_failures"] == 14
    assert found["plan_ms"] == {"p50": 2.0, "p99": 3.0, "max": 3.0}
    assert found["messages"] == {"sent": 100, "dropped": 7, "bad": 3}
    assert (found["seed"], found["vehicles"], found["run_dir"]) == (7, 2, "runs/x")


def test_times() -> None:
    found = summary()
    assert (found["converged"], found["convergence_time_s"]) == (True, 0.3)
    assert found["simulated_s"] == pytest.approx(0.98)
    assert (found["wall_s"], found["cpu_s"], found["real_time_factor"]) == (2.0, 1.5, 0.49)
    assert (found["others_converge_s"], found["uncovered_converge_s"], found["covered_goals"]) == (
        0.2,
        0.1,
        1,
    )
    stuck = summary(converged_at=None)
    assert (stuck["converged"], stuck["convergence_time_s"], stuck["others_converge_s"]) == (False, None, 0.2)
    escort = summary(scenario=scenario(ESCORT, vehicles=2), converged_at=None)
    assert (escort["converged"], escort["convergence_time_s"], escort["others_converge_s"]) == (None,) * 3


def test_violations_are_those_of_vehicles_and_of_the_target() -> None:
    truth = Seen(hovering(50))
    truth.vehicles.count, truth.target.count = 2, 3
    assert summary(truth=truth)["d_min_violations"] == 5


@pytest.mark.parametrize(
    ("of", "methods", "sense", "said"),
    [
        (ANTIPODAL, ("tangential",), "right", ("tangential", "right")),
        (ANTIPODAL, ("baseline", "tangential"), "left", ("baseline+tangential", "left")),
        (JUMP, ("baseline",), "right", ("baseline", "own")),
    ],
)
def test_the_method_and_its_turning_sense_are_named(
    of: Scenario, methods: tuple[str, ...], sense: str, said: tuple[str, str]
) -> None:
    companion = {"methods": methods, "turning_sense": sense}
    found = summary(scenario=scenario(of.name, vehicles=2, companion=companion))
    assert (found["method"], found["turning_sense"]) == said


VALUES = hnp.arrays(
    np.float64, (30, 2), elements=st.one_of(st.floats(0.0, 100.0), st.just(NAN)), fill=st.nothing()
)


@settings(deadline=None, max_examples=50)
@given(VALUES)
def test_percentiles_and_maxima_pass_over_what_is_not_there(values: np.ndarray) -> None:
    samples = hovering(30)
    speeds = np.zeros((30, 2, 3))
    speeds[..., 1] = values
    truth = Seen(samples._replace(reference=speeds, velocity=speeds, tilt=values))
    found = summary(truth=truth, clock_start=0, clock_end=1 << 60)
    there = values[np.isfinite(values)]
    tracking = found["tracking_error_m"]
    assert isinstance(tracking, dict)
    if not len(there):
        assert tracking == {"p95": None, "max": None}
        assert found["max_speed_m_s"] is None
        return
    assert tracking["max"] == pytest.approx(there.max(), abs=1e-4)
    assert tracking["p95"] == pytest.approx(np.percentile(there, 95), abs=1e-4)
    assert found["max_speed_m_s"] == pytest.approx(there.max(), abs=1e-3)
    assert found["max_tilt_deg"] == pytest.approx(np.degrees(there.max()), abs=1e-3)


def test_errors_before_and_after_the_clock_do_not_count() -> None:
    samples = hovering(50)
    off = np.zeros((50, 2, 3))
    # The clock runs from sample 10 to 39.
    off[[5, 9, 40, 49], 0, 0] = 9.0
    off[[10, 39], 0, 0] = 2.0
    found = summary(truth=Seen(samples._replace(reference=off, velocity=off)))
    assert found["max_speed_m_s"] == 2.0
    tracking = found["tracking_error_m"]
    assert isinstance(tracking, dict)
    assert tracking["max"] == 2.0


BEARINGS = st.floats(-np.pi, np.pi)


@given(BEARINGS, st.floats(0.1, 50.0), BEARINGS, st.integers(-3, 3))
def test_the_yaw_error_is_the_angle_to_the_target(
    bearing: float, distance: float, error: float, turns: int
) -> None:
    target = distance * np.array([np.cos(bearing), np.sin(bearing), 0.3])
    yaw = np.array([[bearing + error + turns * 2.0 * np.pi]])
    found = yaw_errors(np.zeros((1, 1, 3)), yaw, target[None])
    assert found[0, 0] == pytest.approx(np.degrees(abs(error)), abs=1e-6)
    assert np.isnan(yaw_errors(np.zeros((1, 1, 3)), yaw, np.full((1, 3), NAN))).all()


@given(st.floats(0.0, 20.0), BEARINGS, st.floats(-10.0, 10.0))
def test_the_standoff_error_is_the_distance_to_the_nearest_point_of_the_circle(
    across: float, bearing: float, up: float
) -> None:
    of = scenario(ESCORT, vehicles=1)
    surface = of.companion.surface
    target = np.array([3.0, -2.0, 1.0])
    place = target + np.array([across * np.cos(bearing), across * np.sin(bearing), up])
    (error,) = standoff_errors(cast("Outcome", Flown(scenario=of)), place[None, None], target[None])[0]
    angles = np.linspace(0.0, 2.0 * np.pi, 2_000)
    circle = target + np.column_stack(
        [surface.radius * np.cos(angles), surface.radius * np.sin(angles), np.full(2_000, surface.height)]
    )
    assert error == pytest.approx(np.linalg.norm(circle - place, axis=1).min(), abs=1e-3)


def test_only_escorts_have_a_standoff_error() -> None:
    assert summary()["standoff_error_m"] == {"p50": None, "p95": None}
    found = summary(scenario=JUMP)["standoff_error_m"]
    surface = JUMP.companion.surface
    away = round(float(np.hypot(surface.radius, surface.height)), 4)
    assert found == {"p50": away, "p95": away}


@pytest.mark.parametrize(
    ("violations", "converged", "failure", "status"),
    [
        (0, True, None, 0),
        (0, None, None, 0),
        (1, True, None, 1),
        (1, None, None, 1),
        (0, False, None, 1),
        (0, True, "not all vehicles were down", 1),
        (3, False, "both", 1),
    ],
)
def test_exit_status(violations: int, converged: bool | None, failure: str | None, status: int) -> None:
    found: dict[str, Value] = {
        **summary(),
        "d_min_violations": violations,
        "converged": converged,
        "failure": failure,
    }
    assert exit_status(found) == status


def test_wall_fields_are_keys() -> None:
    assert set(WALL_FIELDS) <= set(summary())


def test_who_turns_over_or_comes_down_makes_it_a_failure() -> None:
    """Between the goal event and the end of the clock (samples 10 to 39), and having been up before."""
    samples = hovering(50)
    up = samples.position + np.array([0.0, 0.0, 5.0])
    assert summary(truth=Seen(samples._replace(position=up)))["failure"] is None
    down = up.copy()
    down[45:, 1, 2] = 0.1
    assert summary(truth=Seen(samples._replace(position=down)))["failure"] is None
    down[30:, 1, 2] = 0.1
    found = summary(truth=Seen(samples._replace(position=down)))
    assert "vehicle 12 came down 0.4 s" in str(found["failure"])
    assert exit_status(found) == 1
    tilt = samples.tilt.copy()
    tilt[20, 0] = np.radians(168.0)
    found = summary(truth=Seen(samples._replace(position=up, tilt=tilt)))
    assert "vehicle 11 turned over 0.2 s after the goal event (tilt 168 deg" in str(found["failure"])
