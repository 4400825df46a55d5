"""Whole flights out of a pocket and through a maze: with ways all arrive, without them none does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from outrider.certify.reading import read
from outrider.certify.verdict import judge
from outrider.replay.run_replay import again
from outrider.resources import config_root
from outrider.simulation.flight import Flight
from outrider.simulation.preparation import Prepared
from outrider.swarm import command as swarm
from tests.scenarios.lockstep_flights import FIREFLY, fly, scenario

AIRBORNE: dict[str, Any] = {"airborne": True}
WITHIN_S = {"pocket": 30.0, "maze": 45.0}

pytestmark = pytest.mark.slow


def flown(name: str, avoidance: str, seed: int, directory: Path, **changes: Any) -> Any:
    companion = {"avoidance": avoidance, **changes.pop("companion", {})}
    return fly(scenario(name, {**AIRBORNE, **changes, "companion": companion}), seed, directory)


@pytest.mark.parametrize("avoidance", ["field", "certified"])
@pytest.mark.parametrize("name", ["pocket", "maze"])
@pytest.mark.parametrize("seed", [1, 2])
def test_all_arrive_and_nobody_touches_anything(name: str, avoidance: str, seed: int, tmp_path: Path) -> None:
    of = flown(name, avoidance, seed, tmp_path)
    summary = of.summary
    assert summary["converged"]
    assert summary["convergence_time_s"] < WITHIN_S[name]
    assert summary["d_min_violations"] == 0
    assert summary["solver_failures"] == 0
    assert of.flight.truth.obstacles.minimum > of.flight.scenario.d_min_obstacle
    assert of.watch.plans_finite
    assert of.flight.conductor.failure is None


@pytest.mark.parametrize(("name", "least"), [("pocket", 8.0), ("maze", 15.0)])
def test_without_ways_nobody_gets_near_in_the_field(name: str, least: float, tmp_path: Path) -> None:
    of = flown(name, "field", 1, tmp_path, cap_s=WITHIN_S[name], companion={"way": None})
    places = of.flight.truth.samples().position
    goals = np.array(of.flight.scenario.starts.goals)
    assert not of.summary["converged"]
    assert np.linalg.norm(places - goals, axis=2).min() > least


@pytest.mark.parametrize("avoidance", ["field", "certified"])
def test_the_same_seed_is_the_same_flight_in_any_order_and_in_two_processes(
    avoidance: str, tmp_path: Path
) -> None:
    of = scenario("pocket", {**AIRBORNE, "cap_s": 6.0, "companion": {"avoidance": avoidance}})
    logs = []
    for processes, reverse in ((1, False), (1, True), (2, False)):
        directory = tmp_path / f"{processes}-{reverse}"
        directory.mkdir()
        flight = Flight(
            of,
            FIREFLY,
            3,
            config_root() / "logs",
            run_directory=directory,
            stopwatch=lambda: 0,
            processes=processes,
            reverse_nodes=reverse,
        )
        flight.run()
        logs.append({path.name: path.read_bytes() for path in sorted(directory.iterdir())})
    assert len(logs[0]) == 2 * of.size
    assert logs[0] == logs[1] == logs[2]


@pytest.mark.parametrize("avoidance", ["field", "certified"])
def test_a_run_is_replayed_from_its_logs_to_the_byte_and_its_plans_verified(
    avoidance: str, tmp_path: Path
) -> None:
    of = scenario("pocket", {**AIRBORNE, "cap_s": 8.0, "companion": {"avoidance": avoidance}})
    directory = tmp_path / "run"
    directory.mkdir()
    swarm.fly(Prepared(of, FIREFLY), 1, directory, lambda _stage, _seconds: None)
    for one in again(directory):
        assert one.identical, one
    if avoidance == "certified":
        assert judge(read(directory, lambda _name, _share: None)).findings == ()
