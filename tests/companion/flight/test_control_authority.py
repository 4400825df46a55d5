"""Whose the vehicle is: who takes it over keeps it, and only an accident is made good."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.values.phase import Phase
from tests.companion.bench import FLAVOURS, PROFILES
from tests.companion.flight.rig import (
    HEALTHY,
    HEIGHT,
    IN_FLIGHT,
    READY,
    Rig,
    beat,
    landed,
    state,
)


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("landing", [False, True])
def test_who_takes_the_vehicle_over_by_its_mode_switch_has_it_until_a_new_go(flavour, landing):
    """Nothing is sent, nothing is ordered back; not when its mode is ours again either: that may be a ground
    station that flies it."""
    rig = Rig(flavour).escorting()
    if landing:
        rig.pilot.land()
    assert rig.run(60.0, beat(flavour, armed=True, guided=False)) == []
    assert rig.pilot.phase is Phase.YIELDED
    assert not rig.pilot.streaming
    assert rig.run(60.0, beat(flavour, armed=True, guided=True)) == []
    assert rig.pilot.phase is Phase.YIELDED
    assert not rig.pilot.streaming
    assert not rig.pilot.land()
    assert not rig.pilot.come_back()
    assert not rig.pilot.hold()


HOLD = {flavour: profile.hold_mode for flavour, profile in PROFILES.items()}
MANUAL = {"ardupilot": (0, 2, 5, 6, 16), "px4": (1 << 16, 2 << 16, 3 << 16, 4 << 16 | 5 << 24)}


def climbing(flavour, height):
    """Armed, told to take off, ``height`` up."""
    rig = Rig(flavour).prepared()
    up = beat(flavour, armed=True, guided=flavour == "ardupilot")
    rig.run(0.5, up, landed(1), acks=True)
    rising = beat(flavour, armed=True, mode=min(PROFILES[flavour].takeoff_modes, default=4))
    rig.view = READY._replace(own=state(height, 1.0))
    rig.run(0.5, rising, landed(3), acks=True)
    assert rig.pilot.phase is Phase.PREPARE
    return rig


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("height", [0.3 * HEIGHT, 0.9 * HEIGHT])
def test_who_takes_it_over_on_the_way_up_has_it(flavour, height):
    for mode in MANUAL[flavour]:
        rig = climbing(flavour, height)
        assert rig.run(60.0, beat(flavour, armed=True, mode=mode), landed(2)) == []
        assert rig.pilot.phase is Phase.YIELDED
        assert not rig.pilot.streaming


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_pause_on_the_way_up_is_somebodys_will_and_the_end_of_it_is_not(flavour):
    """PX4 holds when it has risen."""
    rig = climbing(flavour, 0.5 * HEIGHT)
    held = beat(flavour, armed=True, mode=HOLD[flavour])
    assert rig.run(10.0, held, landed(2)) == []
    assert rig.pilot.phase is Phase.YIELDED
    rig = climbing("px4", 0.95 * HEIGHT)
    held = beat("px4", armed=True, mode=HOLD["px4"])
    rig.view = READY._replace(own=state(HEIGHT))
    assert mavlink.MAV_CMD_DO_SET_MODE in {command for command, _ in rig.run(5.0, held, landed(2))}


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_who_takes_it_over_on_the_way_down_has_it(flavour):
    for before in (0.0, 1.0):
        for mode in MANUAL[flavour]:
            rig = Rig(flavour).escorting()
            rig.pilot.land()
            rig.pilot.settled()
            landing = beat(flavour, armed=True, mode=min(PROFILES[flavour].land_modes))
            rig.run(before, landing, landed(2), acks=True)
            assert rig.run(60.0, beat(flavour, armed=True, mode=mode), landed(2)) == []
            assert rig.pilot.phase is Phase.YIELDED


def test_a_mode_switched_away_on_the_ground_takes_the_go_back():
    rig = Rig("ardupilot").prepared()
    rig.run(0.2, beat("ardupilot", guided=True), HEALTHY, acks=True)
    rig.run(0.2, beat("ardupilot"), HEALTHY, acks=True)
    sent = rig.run(30.0, beat("ardupilot", guided=True), HEALTHY, acks=True)
    assert not {command for command, _ in sent} & {
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
        mavlink.MAV_CMD_DO_SET_MODE,
        mavlink.MAV_CMD_NAV_TAKEOFF,
    }
    assert rig.pilot.waiting_for == "the operator's go"


@pytest.mark.parametrize("mode", [0, 3 << 16, HOLD["px4"]])
def test_what_happened_while_nothing_was_heard_may_have_been_a_pilot(mode):
    rig = Rig("px4").escorting()
    rig.pilot.streamed(rig.now)
    rig.run(4.0)
    assert rig.run(10.0, beat("px4", armed=True, mode=mode)) == []
    assert rig.pilot.phase is Phase.YIELDED


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_new_go_takes_the_vehicle_back_in_flight_and_asks_for_the_mode_alone(flavour):
    rig = Rig(flavour).escorting()
    rig.run(5.0, beat(flavour, armed=True), HEALTHY, IN_FLIGHT)
    assert rig.pilot.phase is Phase.YIELDED
    assert rig.pilot.go(HEIGHT)
    sent = rig.run(3.0, beat(flavour, armed=True), HEALTHY, IN_FLIGHT, acks=True)
    assert {command for command, _ in sent} == {
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_DO_SET_MODE,
    }
    rig.run(0.2, beat(flavour, armed=True, guided=True))
    assert rig.pilot.phase is Phase.ESCORT


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("guided", [False, True])
def test_who_disarms_it_ends_the_flight(flavour, guided):
    """Armed again by somebody, who will not expect it to fly: a new go is needed."""
    rig = Rig(flavour).escorting()
    rig.run(0.1, beat(flavour, guided=guided))
    assert rig.pilot.phase is Phase.CONNECT
    sent = rig.run(3.0, beat(flavour, armed=True, guided=True), HEALTHY, IN_FLIGHT, acks=True)
    assert {command for command, _ in sent} == {
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_REQUEST_MESSAGE,
    }
    assert rig.pilot.waiting_for == "the operator's go"
    assert not rig.pilot.streaming


LOSS = sorted(PROFILES["px4"].loss_modes)


@pytest.mark.parametrize("mode", LOSS)
@pytest.mark.parametrize("gap", [2.0, 0.0], ids=["after a gap", "out of the blue"])
def test_px4_is_asked_for_offboard_again_only_where_missing_set_points_ended_it(mode, gap):
    rig = Rig("px4").escorting()
    flying = beat("px4", armed=True, guided=True)
    lost = flying._replace(custom_mode=mode)
    for _ in range(100):
        rig.pilot.streamed(rig.now)
        rig.tick(flying)
    rig.now += round(gap * 1e6)
    sent = rig.tick(lost)
    if not gap:
        assert rig.pilot.phase is Phase.YIELDED
        return
    assert [command for command, _ in sent] == [mavlink.MAV_CMD_DO_SET_MODE]
    assert rig.pilot.streaming
    rig.pilot.streamed(rig.now)
    rig.tick(flying)
    assert rig.pilot.phase is Phase.ESCORT
    # Later on it was somebody.
    for _ in range(500):
        rig.pilot.streamed(rig.now)
        rig.tick(flying)
    assert rig.tick(lost) == []
    assert rig.pilot.phase is Phase.YIELDED


def test_asking_for_offboard_again_ends():
    rig = Rig("px4").escorting()
    flying = beat("px4", armed=True, guided=True)
    rig.pilot.streamed(rig.now)
    rig.tick(flying)
    rig.now += 2_000_000
    lost = flying._replace(custom_mode=LOSS[0])
    sent = []
    for _ in range(1000):
        rig.pilot.streamed(rig.now)
        sent += rig.tick(lost)
    assert {command for command, _ in sent} == {mavlink.MAV_CMD_DO_SET_MODE}
    assert rig.pilot.phase is Phase.YIELDED


def test_a_switch_to_a_mode_of_a_pilot_is_no_accident_even_after_a_gap():
    rig = Rig("px4").escorting()
    rig.pilot.streamed(rig.now)
    rig.now += 2_000_000
    manual = beat("px4", armed=True)._replace(custom_mode=1 << 16)
    assert rig.tick(manual) == []
    assert rig.pilot.phase is Phase.YIELDED


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_without_a_heartbeat_nothing_is_guided(flavour):
    rig = Rig(flavour).escorting()
    assert rig.pilot.guided
    rig.run(4.0)
    assert not rig.pilot.guided
    assert not rig.pilot.streaming


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_who_took_the_vehicle_over_while_it_settles_keeps_it(flavour):
    rig = Rig(flavour).escorting()
    assert rig.pilot.land()
    taken = beat(flavour, armed=True, guided=False)
    assert rig.run(CompanionConfig().guard.settle_us * 1e-6 + 1.0, taken) == []
    assert not rig.pilot.streaming


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_nothing_is_sent_on_the_way_up_to_an_autopilot_that_is_not_heard(flavour):
    """A pilot may have it meanwhile; then it is the pilot's."""
    rig = climbing(flavour, HEIGHT)
    rig.run(3.1)
    assert rig.run(60.0) == []
    assert not rig.pilot.streaming
    assert rig.tick(beat(flavour, armed=True, mode=MANUAL[flavour][1])) == []
    assert rig.pilot.phase is Phase.YIELDED


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_nothing_is_sent_on_the_way_down_to_an_autopilot_that_is_not_heard(flavour):
    rig = climbing(flavour, HEIGHT)
    assert rig.pilot.land()
    mode = next(iter(PROFILES[flavour].takeoff_modes), PROFILES[flavour].guided_custom_mode)
    assert rig.run(1.0, beat(flavour, armed=True, mode=mode), landed(2))
    rig.run(3.1)
    assert rig.run(60.0) == []
    assert rig.tick(beat(flavour, armed=True, mode=MANUAL[flavour][1]), landed(2)) == []
    assert rig.pilot.phase is Phase.YIELDED
