"""Fleets of either vehicle swap places on either physics, and it makes hardly a difference."""

from __future__ import annotations

from typing import Any

import pytest

from outrider.resources import find
from outrider.simulation.preparation import Prepared, measure
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig
from tests.scenarios.lockstep_flights import scenario

pytestmark = pytest.mark.slow


def swap(vehicle: str, physics: str) -> dict[str, Any]:
    of = scenario("antipodal", {"vehicles": 2, "vehicle": vehicle, "physics": physics})
    return measure(Prepared(of, load(find("vehicles", vehicle), VehicleConfig)), seed=1)


@pytest.mark.parametrize("vehicle", ["firefly", "hummingbird"])
def test_two_swap_places(vehicle: str) -> None:
    pytest.importorskip("jsbsim", reason="there is no wheel of JSBSim for this machine")
    own, jsbsim = swap(vehicle, "own"), swap(vehicle, "jsbsim")
    for flown in (own, jsbsim):
        assert flown["converged"]
        assert flown["d_min_violations"] == 0
    assert jsbsim["convergence_time_s"] == pytest.approx(own["convergence_time_s"], abs=0.1)
    assert jsbsim["min_separation_m"] == pytest.approx(own["min_separation_m"], abs=0.05)
