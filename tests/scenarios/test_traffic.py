"""Obstacles that move through a flight: everybody hears of them, and nobody touches one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from outrider.runs.figures import draw
from outrider.runs.summary import exit_status
from tests.scenarios.flight_facts import check_told, clock, spoke
from tests.scenarios.lockstep_flights import fly, scenario


@pytest.mark.slow
@pytest.mark.parametrize(
    "companion",
    [
        {"neighbour_prediction": "held"},
        {"neighbour_prediction": "velocity"},
        {"avoidance": "certified", "turning_sense": "right"},
    ],
    ids=["held", "velocity", "certified"],
)
def test_nobody_touches_what_comes_across(companion: dict[str, str], tmp_path: Path) -> None:
    change = {"airborne": True, "vehicles": 4, "companion": companion}
    of = scenario("traffic", change)
    flown = fly(of, 2, tmp_path)
    check_told(flown)
    summary, flight = flown.summary, flown.flight
    assert summary["converged"] is True
    assert exit_status(summary) == 0
    nearest = summary["min_obstacle_distance_m"]
    assert isinstance(nearest, float)
    # They met, and nobody came too near.
    assert of.d_min_obstacle <= nearest < 2.0
    for system in flight.systems:
        assert {190, 191} <= spoke(flown, system)
    samples, time = clock(flown)
    for j, node in enumerate(flight.moving):
        expected = [node.motion(int(now)).position for now in samples.time[::50]]
        np.testing.assert_allclose(samples.moving[::50, j], expected, atol=1e-9)
        gone = np.linalg.norm(np.diff(samples.moving[:, j], axis=0), axis=1).sum()
        assert gone > 0.9 * of.moving[j].speed * (time[-1] - 2.0)
    before = flight.truth.samples(until=flight.conductor.clock_start).moving
    assert np.ptp(before, axis=0).max() == 0.0
    draw(flight.outcome, summary, tmp_path / "flight.png")
    assert (tmp_path / "flight.png").stat().st_size > 10_000
