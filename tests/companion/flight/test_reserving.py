"""Neither a take-off nor a landing is ordered before the column is reserved."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.flight.state_machine import Pilot
from companion.values.phase import Phase
from companion.values.stance import Stance
from tests.companion.bench import FLAVOURS
from tests.companion.flight.rig import HEALTHY, HEIGHT, IN_FLIGHT, Rig, beat, landed

ON_GROUND = landed(mavlink.MAV_LANDED_STATE_ON_GROUND)
WAITS = "the agreement of 12 on its column"
ACTS = {mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_LAND}


def acts(sent):
    return [command for command, _ in sent if command in ACTS]


def waiting(flavour) -> Rig:
    rig = Rig(flavour)
    rig.pilot.column_waits = WAITS
    rig.run(0.2, beat(flavour), HEALTHY, ON_GROUND, acks=True)
    assert rig.pilot.stance is Stance.PARKED
    assert rig.pilot.go(HEIGHT)
    return rig


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_it_is_not_armed_before_its_column_is_reserved(flavour):
    rig = waiting(flavour)
    sent = rig.run(2.0, beat(flavour), HEALTHY, ON_GROUND, acks=True)
    assert acts(sent) == []
    assert (rig.pilot.phase, rig.pilot.stance) == (Phase.CONNECT, Stance.JOINS)
    assert rig.pilot.waiting_for == WAITS
    rig.pilot.column_waits = ""
    rig.run(0.2, beat(flavour), HEALTHY, ON_GROUND, acks=True)
    assert (rig.pilot.phase, rig.pilot.stance) == (Phase.PREPARE, Stance.CLIMBS)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_it_does_not_climb_when_the_reservation_is_lost(flavour):
    rig = waiting(flavour)
    rig.pilot.column_waits = ""
    rig.run(0.1, beat(flavour), HEALTHY, ON_GROUND, acks=True)
    rig.pilot.column_waits = WAITS
    guided = beat(flavour, armed=True, guided=flavour == "ardupilot")
    sent = rig.run(1.0, guided, HEALTHY, ON_GROUND, acks=True)
    assert mavlink.MAV_CMD_NAV_TAKEOFF not in acts(sent)
    assert rig.pilot.waiting_for == WAITS
    rig.pilot.column_waits = ""
    assert mavlink.MAV_CMD_NAV_TAKEOFF in acts(rig.run(1.0, guided, HEALTHY, ON_GROUND, acks=True))


def test_a_go_that_waits_for_its_column_expires():
    rig = waiting("ardupilot")
    keeps = 1e-6 * CompanionConfig().guard.go_keeps_us
    rig.run(keeps + 1.0, beat("ardupilot"), HEALTHY, ON_GROUND)
    assert rig.pilot.stance is Stance.PARKED


def settling() -> tuple[Rig, Pilot]:
    rig = Rig("ardupilot").escorting()
    rig.pilot.column_waits = WAITS
    assert rig.pilot.land()
    rig.pilot.settled()
    return rig, rig.pilot


def test_it_lands_once_its_column_is_reserved():
    rig, pilot = settling()
    flying = beat("ardupilot", armed=True, guided=True)
    assert acts(rig.run(1.0, flying, IN_FLIGHT)) == []
    assert (pilot.phase, pilot.stance) == (Phase.SETTLE, Stance.LOWERS)
    pilot.column_waits = ""
    assert mavlink.MAV_CMD_NAV_LAND in acts(rig.run(0.5, flying, IN_FLIGHT))
    assert pilot.phase is Phase.LAND


def test_it_lands_without_a_reservation_when_the_time_is_over():
    """A battery does not last for ever."""
    rig, pilot = settling()
    flying = beat("ardupilot", armed=True, guided=True)
    seconds = 1e-6 * CompanionConfig().guard.settle_us
    rig.run(seconds - 1.0, flying, IN_FLIGHT)
    assert pilot.phase is Phase.SETTLE
    rig.run(2.0, flying, IN_FLIGHT)
    assert pilot.phase is Phase.LAND
