"""Vehicles whose autopilots follow set-points as their firmware does keep apart, and where they should be."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from outrider.resources import find
from outrider.scenarios.changes import merged
from outrider.scenarios.fly_config import FlyConfig
from outrider.scenarios.options import Options, apply
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.yaml_file import load
from tests.scenarios.lockstep_flights import fly, setpoints

SORTIE = load(find("scenarios", "sortie"), Scenario)


def row(count: int) -> Scenario:
    places = [[0.0, 5.0 * k, 5.0] for k in range(count)]
    starts = {"kind": "points", "at": places}
    return Scenario.model_validate({**SORTIE.model_dump(), "vehicles": count, "starts": starts})


def of(count: int, **options: object) -> Scenario:
    return apply(row(count), Options(**options))


@pytest.mark.parametrize("name", ["ardupilot", "px4"])
def test_its_companions_have_the_settings_of_the_shipped_files(name: str) -> None:
    assert SORTIE.companion == load(find("companions", name), FlyConfig).companion


CALM = [
    pytest.param(of(5), 5, id="five ArduCopters"),
    pytest.param(of(5, flavour="px4"), 6, id="five PX4s"),
    pytest.param(of(8, flavour="ardupilot,px4"), 7, id="eight mixed"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "seed"), CALM)
def test_in_calm_air_vehicles_keep_apart_and_follow(scenario: Scenario, seed: int, tmp_path: Path) -> None:
    flown = fly(scenario, seed, tmp_path)
    summary = flown.summary
    assert summary["failure"] is None
    assert summary["d_min_violations"] == 0
    assert summary["min_separation_m"] >= 1.5
    assert summary["tracking_error_m"]["p95"] <= 0.35
    assert summary["anchored_anew"] == 0
    assert summary["standoff_error_m"]["p95"] <= 0.6
    assert largest_step(tmp_path) <= 0.3


@pytest.mark.slow
def test_in_wind_and_with_loss_no_two_come_too_near(tmp_path: Path) -> None:
    flown = fly(of(8, flavour="ardupilot,px4", wind="4", loss=0.2), 8, tmp_path)
    assert flown.summary["failure"] is None
    assert flown.summary["d_min_violations"] == 0
    assert flown.summary["anchored_anew"] == 0


@pytest.mark.slow
def test_vehicles_that_return_soon_after_gathering_keep_apart(tmp_path: Path) -> None:
    """Their ways cross: each is in its lane before it sets off."""
    mixed = of(8, flavour="ardupilot,px4").model_dump()
    flown = fly(Scenario.model_validate(merged(mixed, {"cap_s": 8.0})), 6, tmp_path)
    assert flown.summary["failure"] is None
    assert flown.summary["min_separation_m"] >= 1.5


LATE = {
    "companion": {"rates": {"replan_us": 200_000}},
    "target": {"through": [[8.0, 8.0, 1.5], [15.0, 19.0, 1.5], [2.0, 19.0, 1.5]], "speed": 1.5, "paces": []},
    "cap_s": 60.0,
}
"""Five plans a second, as of a computer that cannot keep up; and a target that leads past the same places."""


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "fault"), [(1, (13, 23.81)), (3, (15, 6.68))])
def test_a_vehicle_without_a_companion_is_passed_by_companions_that_are_late(
    seed: int, fault: tuple[int, float], tmp_path: Path
) -> None:
    gone = {"faults": [{"kind": "vanish", "vehicle": fault[0], "at_s": fault[1]}]}
    flown = fly(
        Scenario.model_validate(merged(merged(of(5, flavour="px4").model_dump(), LATE), gone)), seed, tmp_path
    )
    assert flown.summary["failure"] is None
    assert flown.summary["min_separation_m"] >= 1.5


def largest_step(directory: Path) -> float:
    """By how much (m) a set-point is beside what the one before leads to."""
    most = 0.0
    for log in directory.glob("*.tlog"):
        for before, after in pairwise(setpoints(log)):
            dt = 1e-6 * (after.time_boot - before.time_boot)
            if dt < 0.1:
                p, v, a = (np.array(part) for part in (before.position, before.velocity, before.acceleration))
                most = max(most, float(np.linalg.norm(p + dt * v + 0.5 * dt * dt * a - after.position)))
    return most
