"""Limits for plans, with and without a floor above the place of the take-off."""

from __future__ import annotations

import pytest

from companion.config import CompanionConfig
from companion.flight.state_machine import Pilot
from companion.values.phase import Phase
from tests.companion.bench import FLEET
from tests.companion.flight.rig import GROUND, HEALTHY, HEIGHT, IN_FLIGHT, OWN, READY, Rig, beat, state


@pytest.mark.parametrize(
    ("least", "floor"), [(None, 1.0), (0.2, GROUND + 0.2), (4.0, GROUND + 4.0), (90.0, 76.0)]
)
def test_the_floor_is_above_the_take_off_where_that_is_asked_for(least, floor):
    """Three quarters of the box at most, so that a vehicle finds room."""
    limits = {"box_min": (-9.0, -9.0, 1.0), "box_max": (9.0, 9.0, 101.0)}
    config = CompanionConfig.model_validate({"guard": {"least_height": least}, "limits": limits})
    rig = Rig()
    rig.pilot = Pilot(config, OWN, FLEET.altitude)
    assert rig.pilot.planned.lowered.limits.box_min[2] == 1.0
    rig.escorting()
    assert rig.pilot.planned.lowered.limits.box_min == (-9.0, -9.0, pytest.approx(floor))
    assert rig.pilot.planned.lowered is rig.pilot.planned.lowered
    assert rig.pilot.planned_limits is rig.pilot.planned.lowered.limits


def test_a_vehicle_that_is_taken_over_in_flight_has_no_floor_above_its_take_off():
    rig = Rig()
    rig.pilot = Pilot(CompanionConfig.model_validate({"guard": {"least_height": 3.0}}), OWN, FLEET.altitude)
    rig.view = READY._replace(own=state(HEIGHT))
    flying = beat(rig.flavour, armed=True, guided=True), IN_FLIGHT
    rig.run(0.2, *flying, HEALTHY, acks=True)
    assert rig.pilot.go(HEIGHT)
    rig.run(0.2, *flying)
    assert rig.pilot.phase is Phase.ESCORT
    assert rig.pilot.planned.lowered is rig.pilot.limits.lowered
