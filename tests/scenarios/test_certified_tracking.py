"""How far vehicles with the response of their firmware are from their committed plans."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from companion.node import Companion
from companion.planning.certified import CertifiedAvoidance
from tests.scenarios.lockstep_flights import fly, scenario

pytestmark = pytest.mark.slow
SWAP: dict[str, Any] = {
    "vehicles": 2,
    "airborne": True,
    "sensors": "rtk",
    "autopilot": {"response": "firmware"},
    "companion": {
        "avoidance": "certified",
        "turning_sense": "right",
        "limits": {"v_max": [3.5, 3.5, 1.5], "u_max": [2.0, 2.0, 2.0]},
    },
}
HELPED = {"companion": {"tracking": {"compensate": True}, "limits": {"j_max": [3.5, 3.5, 3.5]}}}
"""As in the shipped companion files."""


def deviation(companion: Companion) -> float:
    avoidance = companion.avoidance
    assert isinstance(avoidance, CertifiedAvoidance)
    return avoidance._flight.tube.largest_deviation


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_smooth_plans_and_feed_forward_more_than_halve_the_tracking_error(
    flavour: str, tmp_path: Path
) -> None:
    largest = []
    for name, changes in (("plain", {}), ("helped", HELPED)):
        flown = fly(scenario("antipodal-8", {**SWAP, "flavour": flavour}, changes), 1, tmp_path / name)
        assert flown.summary["d_min_violations"] == 0
        assert flown.summary["solver_failures"] == 0
        largest.append(max(deviation(companion) for companion in flown.flight.companions))
    assert largest[1] < 0.5 * largest[0]
