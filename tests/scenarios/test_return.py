"""Where a vehicle landed that was to come back is what was measured, whatever ended its way."""

from __future__ import annotations

import numpy as np
import pytest

from companion.values.phase import Phase
from tests.scenarios.single_vehicle import LAND, RETURN, SingleVehicle
from tests.scenarios.test_slow_clock import go_to


def far_off(flavour, **settings):
    vehicle = SingleVehicle(flavour, settings).fly()
    start = vehicle.companion.pilot.start.copy()
    go_to(vehicle, [16.0, 12.0, 6.0])
    vehicle.run(12.0)
    assert vehicle.companion.pilot.landing is None
    return vehicle, start


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_who_came_back_stands_where_it_started(flavour):
    vehicle, start = far_off(flavour)
    vehicle.order(RETURN)
    vehicle.until(Phase.DONE)
    landing = vehicle.companion.pilot.landing
    assert landing.returning
    assert landing.off < 0.6
    assert landing.off == pytest.approx(np.linalg.norm((vehicle.place - start)[:2]), abs=0.05)


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_who_lost_its_place_on_the_way_back_and_landed_there_says_how_far_off_that_is(flavour):
    vehicle, start = far_off(flavour)
    vehicle.order(RETURN)
    vehicle.run(1.5)
    vehicle.mute = True
    vehicle.run(7.0)
    assert vehicle.phase in (Phase.LAND, Phase.DONE)
    vehicle.mute = False
    vehicle.until(Phase.DONE)
    landing = vehicle.companion.pilot.landing
    off = np.linalg.norm((vehicle.place - start)[:2])
    assert off > 6.0
    assert landing.returning
    assert landing.off == pytest.approx(off, abs=0.1)


def test_who_is_blind_to_the_end_claims_nothing():
    vehicle, _ = far_off("px4")
    vehicle.order(RETURN)
    vehicle.run(1.5)
    vehicle.mute = True
    vehicle.until(Phase.DONE)
    assert vehicle.companion.pilot.landing == (True, None)


@pytest.mark.parametrize("orders", [(RETURN, LAND), (LAND,)])
def test_who_is_told_to_land_where_it_is_was_not_to_come_back(orders):
    vehicle, start = far_off("ardupilot")
    for order in orders:
        vehicle.order(order)
        vehicle.run(1.0)
    vehicle.until(Phase.DONE)
    landing = vehicle.companion.pilot.landing
    assert not landing.returning
    assert landing.off == pytest.approx(np.linalg.norm((vehicle.place - start)[:2]), abs=0.1)


def test_as_near_as_the_box_lets_it_is_its_place():
    """It was carried out of the box to where it started."""
    limits = {"box_min": [4.0, 4.0, 2.0], "box_max": [40.0, 40.0, 20.0]}
    vehicle, start = far_off("px4", limits=limits)
    vehicle.order(RETURN)
    vehicle.until(Phase.DONE)
    assert np.linalg.norm((vehicle.place - start)[:2]) > 4.0
    assert vehicle.companion.pilot.landing.off < 0.6
