"""Vehicles of a sortie keep apart in wind, on their early return, and beside one whose companion is gone."""

from __future__ import annotations

from pathlib import Path

import pytest

from outrider.scenarios.changes import merged
from outrider.scenarios.scenario import Scenario
from tests.scenarios.lockstep_flights import fly
from tests.scenarios.sortie import of


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
