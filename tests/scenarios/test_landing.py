"""An order to land ends on the ground, wherever it finds the vehicles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from outrider.simulation import conductor
from outrider.simulation.conductor import Stage
from outrider.simulation.flight import Flight
from outrider.simulation.operator import Operator
from tests.scenarios.lockstep_flights import fly, scenario


def test_who_hovers_above_a_landed_vehicle_lands_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first vehicle lands where it is, which is where the second has to go: it must move aside in the
    end."""
    monkeypatch.setitem(conductor._LAND_CAPS, "land", 25_000_000)

    def stay(self: Operator, system: int, position: np.ndarray) -> None:
        if system == 11:
            self.land(system)
        else:
            go(self, system, position)

    go = Operator.goal
    monkeypatch.setattr(Operator, "goal", stay)
    flown = fly(scenario("antipodal-8", {"vehicles": 2, "cap_s": 12.0}), 1, tmp_path)
    flight: Flight = flown.flight
    assert flight.conductor.stage is Stage.DONE
    samples = flight.truth.samples(flight.conductor.clock_start or 0, flight.conductor.clock_end)
    above = samples.position[-1, 1] - samples.position[-1, 0]
    assert np.hypot(above[0], above[1]) < 0.6
    assert above[2] > 4.0
    assert flight.conductor.failure is None
    first, second = flight.truth.samples().position[-1]
    assert np.hypot(*(second - first)[:2]) > flight.fleet.vehicle.span
