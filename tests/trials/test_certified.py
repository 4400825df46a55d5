"""Companions with committed plans on emulated vehicles, in real time: whichever of their processes is killed
or stopped, no two vehicles come nearer than d_min, and the logs certify it. These tests really wait; they
assert no timing, and are skipped if the machine stood still."""

from __future__ import annotations

from pathlib import Path

import pytest

from trials.certified import flown
from trials.certified_plan import MIXED, PROCESSES, CertifiedPlan
from trials.separation import STOOD_STILL


@pytest.mark.slow
@pytest.mark.parametrize("victim", PROCESSES)
def test_separation_survives_a_process(victim: str, tmp_path: Path) -> None:
    found = flown(CertifiedPlan(MIXED, 3, victims=(victim,)), tmp_path)
    stood_still = [fault for fault in found["faults"] if fault.endswith(STOOD_STILL)]
    assert found["faults"] == stood_still
    if stood_still:
        pytest.skip(stood_still[0])
    assert len(found["acts"]) == 2
    assert found["least_m"] > 0.5


def test_all_choices_follow_from_the_seed(tmp_path: Path) -> None:
    one, other = (CertifiedPlan(seed=3).document(1, CertifiedPlan(seed=3).random) for _ in range(2))
    assert one == other
    assert one != CertifiedPlan(seed=4).document(1, CertifiedPlan(seed=4).random)
    assert abs(one["clock_error"]["offset_ms"]) <= 5000.0


def test_mixed_vehicles_have_both_kinds_of_autopilots() -> None:
    assert {CertifiedPlan(MIXED).flavour_of(system) for system in range(1, 6)} == {"ardupilot", "px4"}


def test_goals_are_further_apart_than_plans_have_to_be() -> None:
    plan = CertifiedPlan()
    for turn in range(3):
        goals = [plan.goal(system, turn) for system in plan.systems]
        assert len(set(goals)) == len(goals)
        assert all(place[2] == goals[0][2] for place in goals)
