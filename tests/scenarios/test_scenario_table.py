"""The scenarios as a table: each row is one whole flight, from the ground to the ground."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.scenarios.lockstep_flights import check, fly, scenario


@dataclass(frozen=True)
class Row:
    """A flight, and what is expected of it beside what holds for all. ``within_s``: None where there is no
    goal, 0 where it cannot be reached by the cap."""

    name: str
    scenario: str
    changes: dict[str, Any] = field(default_factory=dict)
    seed: int = 1
    within_s: float | None = None
    standoff_p95_m: float | None = None
    slow: bool = False


BASELINE = {"companion": {"methods": ["baseline"]}}
PLANAR = {"companion": {"planar": True}}

ROWS = (
    Row("antipodal-8, tangential", "antipodal-8", within_s=20.0, slow=True),
    Row("scenario I", "scenario-1", within_s=40.0, slow=True),
    Row("walk, 20 s", "walk", {"cap_s": 20.0}, standoff_p95_m=0.5, slow=True),
    # Carried on straight, its target would be 1.6 m beside its bend after a horizon, and this 3 to 12 m.
    Row("run, 20 s", "run", {"cap_s": 20.0}, standoff_p95_m=1.0, slow=True),
    Row("boxes", "boxes", seed=2, within_s=15.0, slow=True),
    Row("boxes, certified", "boxes", {"companion": {"avoidance": "certified"}}, within_s=12.0, slow=True),
    Row("antipodal for ten", "antipodal", {"vehicles": 10}, within_s=25.0, slow=True),
    Row("escort, 10 s", "escort", {"target": {"duration_s": 10.0}}, standoff_p95_m=2.0),
    # 16 m from rest to rest with 2 m/s² take 5.7 s: a cap of 5 s is never enough.
    Row("antipodal, baseline", "antipodal-8", {"vehicles": 3, "cap_s": 5.0, **BASELINE}, within_s=0.0),
    Row(
        "ArduPilot, planar",
        "antipodal-8",
        {"vehicles": 3, "flavour": "ardupilot", **PLANAR},
        seed=2,
        within_s=20.0,
    ),
    Row("PX4", "antipodal-8", {"vehicles": 3, "flavour": "px4"}, seed=3, within_s=20.0),
    Row("alone", "antipodal-8", {"vehicles": 1}, within_s=12.0),
)


@pytest.mark.parametrize(
    "row", [pytest.param(row, id=row.name, marks=[pytest.mark.slow] if row.slow else []) for row in ROWS]
)
def test_a_flight(row: Row, tmp_path: Path) -> None:
    of = scenario(row.scenario, row.changes)
    flown = fly(of, row.seed, tmp_path)
    check(flown)
    summary, flight = flown.summary, flown.flight
    assert (flight.conductor.converged_at is not None) == bool(row.within_s)
    if row.within_s:
        seconds = summary["convergence_time_s"]
        assert isinstance(seconds, float)
        assert 0.0 < seconds < row.within_s
    if row.standoff_p95_m is not None:
        standoff = summary["standoff_error_m"]
        assert isinstance(standoff, dict)
        assert (standoff["p95"] or np.inf) < row.standoff_p95_m
    if of.flavour == "ardupilot":
        # PX4 refuses OFFBOARD until set-points have flowed for a while.
        assert [[*companion.pilot.commands.refusals] for companion in flight.companions] == [[]] * of.vehicles
    if of.companion.planar:
        start, end = flight.conductor.clock_start or 0, flight.conductor.clock_end
        heights = flight.truth.samples(start, end).position[..., 2]
        assert np.abs(heights - of.starts.height).max() < 0.2
