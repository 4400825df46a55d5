"""Vehicles whose autopilots follow set-points as their firmware does keep apart, and where they should be."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from outrider.resources import find
from outrider.scenarios.fly_config import FlyConfig
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.yaml_file import load
from tests.scenarios.lockstep_flights import fly, setpoints
from tests.scenarios.sortie import SORTIE, of


@pytest.mark.parametrize("name", ["ardupilot", "px4"])
def test_its_companions_have_the_settings_of_the_shipped_files(name: str) -> None:
    assert SORTIE.companion == load(find("companions", name), FlyConfig).companion


CALM = [
    # Three minutes each; in CI the mixed flight covers both firmwares.
    pytest.param(of(5), 5, id="five ArduCopters", marks=pytest.mark.soak),
    pytest.param(of(5, flavour="px4"), 6, id="five PX4s", marks=pytest.mark.soak),
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
