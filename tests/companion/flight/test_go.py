"""What a go needs, and how long it keeps; nothing rises without one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.estimation.tracks import State
from companion.values.phase import Phase
from tests.companion.bench import FLAVOURS, PROFILES
from tests.companion.flight.rig import (
    HEALTHY,
    HEIGHT,
    ILL,
    NOTHING,
    READY,
    Rig,
    ack,
    beat,
    landed,
    state,
)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_nothing_is_armed_without_a_go(flavour):
    rig = Rig(flavour)
    sent = rig.run(20.0, beat(flavour), HEALTHY, acks=True)
    assert {command for command, _ in sent} == {
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_REQUEST_MESSAGE,
    }
    assert rig.pilot.phase is Phase.CONNECT


def test_an_order_to_land_takes_an_earlier_go_back():
    rig = Rig(view=READY._replace(local=None))
    assert rig.pilot.go(HEIGHT)
    assert rig.pilot.land()
    rig.view = READY
    assert {command for command, _ in rig.run(5.0, beat("ardupilot"), HEALTHY, acks=True)} == {
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_REQUEST_MESSAGE,
    }
    assert rig.pilot.phase is Phase.CONNECT


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_go_that_came_too_early_is_forgotten(flavour):
    rig = Rig(flavour)
    assert rig.pilot.go(HEIGHT)
    rig.run(30.5, beat(flavour), ILL, acks=True)
    sent = rig.run(30.0, beat(flavour), HEALTHY, acks=True)
    assert not {command for command, _ in sent} & {
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
        mavlink.MAV_CMD_DO_SET_MODE,
        mavlink.MAV_CMD_NAV_TAKEOFF,
    }
    assert rig.pilot.waiting_for == "the operator's go"


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_vehicle_that_does_not_arm_is_not_told_to_for_ever(flavour):
    rig = Rig(flavour).prepared()
    guided = beat(flavour, guided=flavour == "ardupilot")
    rig.run(31.0, guided, HEALTHY, ack(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, result=4))
    rig.sent.clear()
    rig.run(60.0, guided, HEALTHY, ack(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, result=4))
    assert not {command for _, command, _ in rig.sent} & {
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
        mavlink.MAV_CMD_DO_SET_MODE,
        mavlink.MAV_CMD_NAV_TAKEOFF,
    }


@pytest.mark.parametrize(
    ("place", "allowed"),
    [
        ((0.0, 0.0, 0.0), True),
        ((45.0, 0.0, 0.0), True),
        ((0.0, 0.0, -20.0), True),
        ((400.0, 0.0, 0.0), False),
        ((0.0, -400.0, 0.0), False),
        ((0.0, 0.0, -458.0), False),
        ((0.0, 0.0, 60.0), False),
        ((math.nan, 0.0, 0.0), False),
    ],
)
def test_a_vehicle_far_from_the_box_does_not_start(place, allowed):
    rig = Rig("px4", READY._replace(own=State(np.array(place), np.zeros(3), 5_000)))
    rig.run(0.2, beat("px4"), HEALTHY, acks=True)
    assert rig.pilot.go(HEIGHT)
    sent = rig.run(5.0, beat("px4"), HEALTHY, acks=True)
    assert (mavlink.MAV_CMD_COMPONENT_ARM_DISARM in {command for command, _ in sent}) == allowed
    assert allowed or "a start near the box" in rig.pilot.waiting_for


@pytest.mark.parametrize("left", [0.19, 0.02])
def test_with_a_low_battery_nothing_starts(left):
    rig = Rig("px4")
    low = HEALTHY._replace(battery_remaining=left)
    assert rig.pilot.go(HEIGHT)
    sent = rig.run(5.0, beat("px4"), low, acks=True)
    assert mavlink.MAV_CMD_COMPONENT_ARM_DISARM not in {command for command, _ in sent}
    assert rig.pilot.waiting_for == "a battery above 20 %"


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_an_order_to_land_before_the_start_takes_the_go_back(flavour):
    rig = Rig(flavour, NOTHING)
    assert rig.pilot.go(6.0)
    assert rig.pilot.land()
    rig.view = READY
    rig.run(5.0, beat(flavour), HEALTHY, acks=True)
    assert rig.pilot.phase is Phase.CONNECT
    assert rig.pilot.waiting_for == "the operator's go"


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_disarmed_on_the_way_up_it_does_not_arm_again_without_a_new_go(flavour):
    rig = Rig(flavour).prepared()
    rig.run(1.0, beat(flavour, armed=True, guided=True), acks=True)
    assert rig.pilot.phase is Phase.PREPARE
    sent = rig.run(20.0, beat(flavour), HEALTHY, acks=True)
    assert mavlink.MAV_CMD_COMPONENT_ARM_DISARM not in {command for command, _ in sent}
    assert rig.pilot.phase is Phase.CONNECT
    assert rig.pilot.waiting_for == "the operator's go"


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("airborne", [2, 3, 4], ids=["in the air", "taking off", "landing"])
def test_who_may_be_flying_is_never_told_to_take_off(flavour, airborne):
    rig = Rig(flavour, READY._replace(own=state(8.0)))
    assert rig.pilot.go(HEIGHT)
    every = beat(flavour, armed=True, guided=True), HEALTHY, landed(airborne)
    sent = rig.run(4.0, *every, acks=True)
    assert rig.pilot.phase is Phase.ESCORT
    assert not {command for command, _ in sent} & {
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
    }


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("received", [(), (landed(0),)], ids=["nothing said", "undefined"])
def test_an_armed_vehicle_of_which_nobody_says_where_it_is_is_left_alone(flavour, received):
    rig = Rig(flavour, READY._replace(own=state(8.0)))
    assert rig.pilot.go(HEIGHT)
    sent = rig.run(4.0, beat(flavour, armed=True, guided=True), HEALTHY, *received, acks=True)
    assert rig.pilot.phase is Phase.CONNECT
    assert "EXTENDED_SYS_STATE" in rig.pilot.waiting_for
    assert not {command for command, _ in sent} & {
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
    }


def test_what_was_said_of_landing_long_ago_is_forgotten():
    rig = Rig()
    rig.run(0.2, beat("ardupilot", armed=True), HEALTHY, landed(2), acks=True)
    rig.run(4.0, beat("ardupilot", armed=True), HEALTHY, acks=True)
    assert rig.pilot.go(HEIGHT)
    rig.run(1.0, beat("ardupilot", armed=True), HEALTHY, acks=True)
    assert "EXTENDED_SYS_STATE" in rig.pilot.waiting_for


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_go_waits_for_an_autopilot_that_is_heard(flavour):
    rig = Rig(flavour)
    rig.run(1.0, beat(flavour), HEALTHY, acks=True)
    rig.run(10.0, HEALTHY, acks=True)
    assert rig.pilot.go(HEIGHT)
    rig.run(5.0, HEALTHY, acks=True)
    assert rig.pilot.phase is Phase.CONNECT
    assert rig.pilot.waiting_for == "a heartbeat of the autopilot"
    rig.run(0.1, beat(flavour), HEALTHY, acks=True)
    assert rig.pilot.phase is Phase.PREPARE


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_an_order_to_land_that_cannot_be_obeyed_yet_is_refused(flavour):
    """A companion that was started anew in the air, before its first heartbeat."""
    rig = Rig(flavour)
    assert not rig.pilot.land()
    rig.run(0.2, beat(flavour, armed=True, guided=True), landed(2))
    assert rig.pilot.land()
    assert rig.pilot.phase is Phase.LAND


def test_a_go_that_waits_can_be_taken_back_and_one_that_has_begun_goes_on():
    rig = Rig()
    assert rig.pilot.go(HEIGHT)
    rig.pilot.take_back()
    rig.run(5.0, beat("ardupilot"), HEALTHY, acks=True)
    assert rig.pilot.phase is Phase.CONNECT
    rig.prepared()
    rig.pilot.take_back()
    sent = rig.run(1.0, beat("ardupilot", guided=True), HEALTHY, acks=True)
    assert mavlink.MAV_CMD_COMPONENT_ARM_DISARM in {command for command, _ in sent}


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_another_height_is_refused_once_the_way_up_has_begun(flavour):
    rig = Rig(flavour)
    rig.prepared()
    assert not rig.pilot.go(HEIGHT + 1.0)
    assert rig.pilot.go(HEIGHT)
    assert rig.pilot.phase is Phase.PREPARE


def test_who_stands_on_the_ground_is_not_up_however_low_it_is_to_rise():
    rig = Rig("ardupilot")
    rig.run(0.2, beat("ardupilot"), HEALTHY, acks=True)
    assert rig.pilot.go(0.5)
    rig.tick()
    rig.view = READY._replace(own=state(0.25))
    sent = rig.run(1.0, beat("ardupilot", armed=True, guided=True), landed(1), acks=True)
    assert rig.pilot.phase is Phase.PREPARE
    assert mavlink.MAV_CMD_NAV_TAKEOFF in {command for command, _ in sent}


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_landing_before_it_is_known_to_be_armed_ends_when_it_is_known_not_to_be(flavour):
    rig = Rig(flavour)
    rig.prepared()
    waiting, armed = beat(flavour, guided=flavour == "ardupilot"), beat(flavour, armed=True)
    while mavlink.MAV_CMD_COMPONENT_ARM_DISARM not in {command for _, command, _ in rig.sent}:
        rig.run(0.01, waiting, HEALTHY, landed(1), acks=True)
    assert rig.pilot.land()
    # The heartbeats of a whole second may have left before.
    rig.run(1.0, waiting, HEALTHY, landed(1), acks=True)
    assert rig.pilot.phase is Phase.LAND
    sent = rig.run(1.0, armed, HEALTHY, landed(1), acks=True)
    assert mavlink.MAV_CMD_NAV_LAND in {command for command, _ in sent}
    rig.run(3.0, beat(flavour), HEALTHY, landed(1))
    assert rig.pilot.phase is Phase.DONE


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_whose_place_is_lost_for_long_on_the_way_up_lands(flavour):
    rig = Rig(flavour)
    rig.prepared()
    armed = beat(flavour, armed=True, mode=next(iter(PROFILES[flavour].takeoff_modes), 4))
    rig.run(2.0, armed, HEALTHY, landed(2), acks=True)
    assert rig.pilot.phase is Phase.PREPARE
    rig.view = READY._replace(own=state(0.3 * HEIGHT, age=5_100_000))
    sent = rig.run(1.0, armed, HEALTHY, landed(2), acks=True)
    assert rig.pilot.phase is Phase.LAND
    assert mavlink.MAV_CMD_NAV_LAND in {command for command, _ in sent}
