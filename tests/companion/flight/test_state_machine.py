"""The way into the air and back, for both autopilots, driven by messages as a table."""

from __future__ import annotations

import math
import random
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.flight.command_protocol import Commands
from companion.flight.state_machine import Pilot
from companion.values.phase import Phase
from companion.world import View
from mavlink_bridge.messages import Message
from tests.companion.bench import FLEET, ORIGIN_REQUEST, PROFILES, TICK
from tests.companion.flight.rig import (
    FLAVOURS,
    GROUND,
    HALF,
    HEALTHY,
    HEIGHT,
    ILL,
    IN_FLIGHT,
    NOTHING,
    OWN,
    READY,
    Rig,
    ack,
    beat,
    landed,
    state,
)

NEEDED = {
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    mavlink.MAVLINK_MSG_ID_ATTITUDE,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
}


class Want(NamedTuple):
    """What is known to the pilot, what it must then name as missing ("": nothing is), and whether the
    autopilot answers its requests."""

    received: tuple[Message, ...]
    view: View
    go: bool
    missing: str
    answers: bool = True


BEAT = beat("ardupilot")
MISSING = {
    "nothing heard": Want((), NOTHING, True, "a heartbeat of the autopilot"),
    "a companion's own echo": Want((beat("px4", autopilot=8),), READY, True, "a heartbeat of the autopilot"),
    "another firmware": Want((beat("px4", autopilot=4), HEALTHY), READY, True, "an autopilot that is known"),
    "no origin": Want((BEAT, HEALTHY), READY._replace(local=None), True, "GPS_GLOBAL_ORIGIN"),
    "no position": Want((BEAT, HEALTHY), READY._replace(own=None), True, "LOCAL_POSITION_NED"),
    "an old position": Want(
        (BEAT, HEALTHY), READY._replace(own=state(age=500_001)), True, "LOCAL_POSITION_NED"
    ),
    "no attitude": Want((BEAT, HEALTHY), READY._replace(yaw=None), True, "ATTITUDE"),
    "no status": Want((BEAT,), READY, True, "pre-arm checks"),
    "not ready to arm": Want((BEAT, ILL), READY, True, "pre-arm checks"),
    "no go": Want((BEAT, HEALTHY), READY, False, "the operator's go"),
    "no answers": Want((BEAT, HEALTHY), READY, True, "answers to SET_MESSAGE_INTERVAL", answers=False),
    "everything": Want((BEAT, HEALTHY), READY, True, ""),
}


@pytest.mark.parametrize("name", MISSING)
def test_connecting_waits_and_names_what_is_missing(name):
    want = MISSING[name]
    rig = Rig(view=want.view)
    if want.go:
        assert rig.pilot.go(HEIGHT)
    sent = rig.run(3.0, *want.received, acks=want.answers)
    if want.missing:
        assert rig.pilot.phase is Phase.CONNECT
        assert want.missing in rig.pilot.waiting_for
        assert {command for command, _ in sent} <= {
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
            mavlink.MAV_CMD_REQUEST_MESSAGE,
        }
        assert not rig.pilot.streaming
    else:
        assert rig.pilot.phase is Phase.PREPARE


@pytest.mark.parametrize("ticks", range(-2, 3))
def test_a_go_that_expires_as_everything_becomes_ready_must_be_given_again(ticks):
    """The vehicle becomes ready some ticks before or after the go expires."""
    rig = Rig()
    assert rig.pilot.go(HEIGHT)
    rig.run(1e-6 * (CompanionConfig().guard.go_keeps_us + ticks * TICK), BEAT, ILL, acks=True)
    rig.run(2.0, BEAT, HEALTHY, acks=True)
    assert rig.pilot.phase is Phase.CONNECT
    assert "the operator's go" in rig.pilot.waiting_for


ORDER = {
    # Command, parameters, what it waits for, whether set-points flow once it is done.
    "ardupilot": (
        (mavlink.MAV_CMD_DO_SET_MODE, (1.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0), "guided mode", False),
        (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), "arm", False),
        (mavlink.MAV_CMD_NAV_TAKEOFF, (0.0, 0.0, 0.0, HEIGHT), "take-off", True),
    ),
    "px4": (
        (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), "arm", False),
        # PX4 wants its take-off altitude above mean sea level.
        (mavlink.MAV_CMD_NAV_TAKEOFF, (0.0, 0.0, 0.0, FLEET.altitude + GROUND + HEIGHT), "take-off", True),
        (mavlink.MAV_CMD_DO_SET_MODE, (1.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0), "guided mode", True),
    ),
}


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_the_steps_into_the_air_come_in_the_autopilots_order_each_when_the_last_is_done(flavour):
    rig = Rig(flavour).prepared()
    rig.sent.clear()
    armed = guided = False
    for command, params, name, streams in ORDER[flavour]:
        # Acknowledged but not done: it waits, and asks nothing else.
        assert rig.run(2.0, beat(flavour, armed, guided), acks=True) == [(command, params)]
        assert rig.pilot.waiting_for == name
        assert rig.pilot.phase is Phase.PREPARE
        # Set-points flow before the mode is granted where the autopilot wants that, else not.
        assert rig.pilot.streaming == (flavour == "px4" and command == mavlink.MAV_CMD_DO_SET_MODE)
        if command == mavlink.MAV_CMD_NAV_TAKEOFF:
            for height, speed in ((0.5 * HEIGHT, 1.0), (HEIGHT, 1.0), (0.5 * HEIGHT, 0.0)):
                rig.view = READY._replace(own=state(height, speed))
                assert rig.run(0.5, beat(flavour, armed, guided)) == []
            rig.view = READY._replace(own=state(HEIGHT))
        armed |= command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM
        guided |= command == mavlink.MAV_CMD_DO_SET_MODE
        assert rig.tick(beat(flavour, armed, guided)) == []
        # Between two steps, too, this can be asked.
        assert rig.pilot.streaming == streams
    assert rig.pilot.phase is Phase.ESCORT
    assert rig.pilot.streaming
    assert rig.run(5.0, beat(flavour, True, True)) == []


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_command_is_repeated_every_half_second_until_acknowledged(flavour):
    rig = Rig(flavour).prepared()
    rig.run(2.0 - 1e-6 * TICK, beat(flavour))
    first = ORDER[flavour][0]
    times = [now for now, command, params in rig.sent if (command, params) == first[:2]]
    assert np.diff(times).tolist() == [HALF] * 3
    rig.tick(ack(first[0]))
    assert rig.run(5.0, beat(flavour)) == []


def test_a_refused_command_is_noted_and_tried_again():
    rig = Rig().prepared()
    rig.sent.clear()
    for _ in range(200):
        rig.tick(beat("ardupilot"), *[ack(mavlink.MAV_CMD_DO_SET_MODE, 4)] * (rig.now % HALF == 0))
    assert rig.pilot.refusals
    assert set(rig.pilot.refusals) == {f"command {mavlink.MAV_CMD_DO_SET_MODE}: result 4"}
    assert len([1 for _, command, _ in rig.sent if command == mavlink.MAV_CMD_DO_SET_MODE]) >= 3


def test_an_acknowledgement_of_something_else_settles_nothing():
    rig = Rig().prepared()
    rig.run(0.6, beat("ardupilot"))
    rig.tick(
        ack(mavlink.MAV_CMD_COMPONENT_ARM_DISARM),
        ack(mavlink.MAV_CMD_NAV_TAKEOFF),
        ack(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL),
    )
    assert rig.run(1.0, beat("ardupilot"))
    assert rig.pilot.refusals == []


@pytest.mark.parametrize("seed", range(5))
def test_every_stream_is_asked_for_until_the_autopilot_has_heard_it(seed):
    """Half of the requests and a third of the answers are lost; an acknowledgement names no stream."""
    lossy = random.Random(seed)
    rig = Rig(view=READY._replace(local=None))
    received, answers = set(), []
    for _ in range(3000):
        new = rig.tick(beat("ardupilot"), *answers)
        arrived = [call for call in new if lossy.random() > 0.5]
        received |= {
            params[0] for command, params in arrived if command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        }
        answers = [ack(command) for command, _ in arrived if lossy.random() > 0.33]
    # And then for what tells how well it knows its place.
    assert received == NEEDED | {
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    }


def test_an_autopilot_that_answers_no_request_is_asked_for_every_stream():
    rig = Rig(view=NOTHING)
    sent = rig.run(4.0, beat("ardupilot"))
    asked = {params[0] for command, params in sent if command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL}
    assert asked == NEEDED
    assert ORIGIN_REQUEST in {(command, params[0]) for command, params in sent}


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_command_without_effect_is_asked_again_though_acknowledged(flavour):
    rig = Rig(flavour).escorting()
    rig.pilot.land()
    rig.pilot.settled()
    rig.sent.clear()
    rig.run(40.0, beat(flavour, armed=True, guided=True), acks=True)
    times = [now for now, command, _ in rig.sent if command == mavlink.MAV_CMD_NAV_LAND]
    assert len(times) == 3
    assert min(np.diff(times)) > 10_000_000


class Order(NamedTuple):
    """An operator's order in a phase: whether it is taken, and the phase afterwards."""

    phase: Phase
    order: str
    height: float
    taken: bool
    after: Phase


ORDERS = [
    Order(Phase.CONNECT, "go", 6.0, True, Phase.CONNECT),
    Order(Phase.CONNECT, "go", 0.49, False, Phase.CONNECT),
    Order(Phase.CONNECT, "go", 121.0, False, Phase.CONNECT),
    Order(Phase.CONNECT, "go", math.nan, False, Phase.CONNECT),
    Order(Phase.CONNECT, "go", math.inf, False, Phase.CONNECT),
    Order(Phase.CONNECT, "land", 0.0, False, Phase.CONNECT),
    Order(Phase.PREPARE, "go", 6.0, True, Phase.PREPARE),
    Order(Phase.PREPARE, "land", 0.0, True, Phase.LAND),
    Order(Phase.ESCORT, "go", 6.0, True, Phase.ESCORT),
    Order(Phase.ESCORT, "land", 0.0, True, Phase.SETTLE),
    Order(Phase.SETTLE, "land", 0.0, True, Phase.SETTLE),
    Order(Phase.SETTLE, "go", 6.0, False, Phase.SETTLE),
    Order(Phase.LAND, "land", 0.0, True, Phase.LAND),
    Order(Phase.LAND, "go", 6.0, False, Phase.LAND),
    Order(Phase.DONE, "go", 6.0, False, Phase.DONE),
    Order(Phase.DONE, "land", 0.0, True, Phase.DONE),
]


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("case", ORDERS, ids=lambda c: f"{c.phase.value} {c.order} {c.height:g}")
def test_orders(flavour, case):
    rig = Rig(flavour)
    rig.pilot.phase = case.phase
    taken = rig.pilot.go(case.height) if case.order == "go" else rig.pilot.land()
    assert (taken, rig.pilot.phase) == (case.taken, case.after)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_without_a_heartbeat_for_three_seconds_nothing_is_steered(flavour):
    rig = Rig(flavour).escorting()
    rig.run(2.9)
    assert rig.pilot.streaming
    rig.run(0.2)
    assert not rig.pilot.streaming
    rig.tick(beat(flavour, armed=True, guided=True))
    assert rig.pilot.streaming


OFFBOARD, HOLD, AUTO_LAND = 6 << 16, 4 << 16 | 3 << 24, 4 << 16 | 6 << 24


def down(flavour):
    """Landing, told to, and some seconds later."""
    rig = Rig(flavour).escorting()
    rig.pilot.land()
    rig.pilot.settled()
    landing = min(PROFILES[flavour].land_modes)
    rig.run(3.0, beat(flavour, armed=True, mode=landing), landed(4), acks=True)
    rig.sent.clear()
    return rig


@pytest.mark.parametrize("mode", [OFFBOARD, AUTO_LAND])
@pytest.mark.parametrize("acks", [True, False])
def test_a_px4_that_has_landed_is_asked_to_hold_until_it_says_so_for_five_seconds_at_most(mode, acks):
    rig = down("px4")
    assert rig.run(2.4, beat("px4", mode=mode), landed(1), acks=acks) == []
    sent = rig.run(1.0, beat("px4", mode=mode), landed(1), acks=acks)
    assert set(sent) == {(mavlink.MAV_CMD_DO_SET_MODE, (1.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0))}
    assert rig.pilot.phase is Phase.LAND
    assert rig.run(1.0, beat("px4", mode=HOLD), landed(1)) == []
    assert rig.pilot.phase is Phase.DONE
    rig = down("px4")
    rig.run(7.4, beat("px4", mode=mode), landed(1), acks=acks)
    assert rig.pilot.phase is Phase.LAND
    rig.run(0.3, beat("px4", mode=mode), landed(1), acks=acks)
    assert rig.pilot.phase is Phase.DONE


def test_after_landing_nobodys_mode_is_changed_but_the_own_and_an_arducopters_never():
    for flavour, mode in (("px4", 3 << 16), ("px4", HOLD), ("ardupilot", 9), ("ardupilot", 4)):
        rig = down(flavour)
        assert rig.run(3.0, beat(flavour, mode=mode), landed(1)) == []
        assert rig.pilot.phase is Phase.DONE


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("honest", [0, 1, 2], ids=["armed", "in the air", "both"])
def test_a_stranger_in_the_autopilots_name_does_not_end_the_flight(flavour, honest):
    """It says without a pause that the vehicle is disarmed on the ground, the autopilot says otherwise."""
    rig, mode = down(flavour), min(PROFILES[flavour].land_modes)
    truth = [[beat(flavour, armed=True, mode=mode)], [landed(2)]]
    for _ in range(20):
        rig.run(0.98, beat(flavour, mode=mode), landed(1))
        rig.run(0.02, *(truth[honest] if honest < 2 else truth[0] + truth[1]))
        assert rig.pilot.phase is Phase.LAND
    rig.run(8.0, beat(flavour, mode=mode), landed(1), acks=True)
    assert rig.pilot.phase is Phase.DONE


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_vehicle_of_unknown_landed_state_has_not_landed(flavour):
    rig = Rig(flavour).escorting()
    rig.pilot.land()
    rig.pilot.settled()
    rig.run(3.0, beat(flavour, armed=True, guided=True))
    rig.run(20.0, beat(flavour), landed(0))
    assert rig.pilot.phase is Phase.LAND


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_vehicle_that_never_tells_its_landed_state_has_landed_when_it_is_disarmed_for_ten_seconds(flavour):
    rig = Rig(flavour).escorting()
    rig.pilot.land()
    rig.pilot.settled()
    mode = PROFILES[flavour].hold_mode
    rig.run(3.0, beat(flavour, armed=True, guided=True))
    for _ in range(4):
        # A heartbeat in a stranger's name, and the autopilot's own, which contradicts it.
        rig.run(9.0, beat(flavour, mode=mode))
        rig.run(0.1, beat(flavour, armed=True, mode=min(PROFILES[flavour].land_modes)))
        assert rig.pilot.phase is Phase.LAND
    rig.run(9.8, beat(flavour, mode=mode))
    assert rig.pilot.phase is Phase.LAND
    rig.run(0.5, beat(flavour, mode=mode))
    assert rig.pilot.phase is Phase.DONE


def test_a_px4_that_falls_silent_when_it_has_landed_is_not_waited_for():
    rig = down("px4")
    rig.run(0.1, beat("px4", mode=OFFBOARD), landed(1))
    rig.run(8.0)
    assert rig.pilot.phase is Phase.DONE


@pytest.mark.parametrize("health", [HEALTHY, ILL], ids=["passes", "fails"])
@pytest.mark.parametrize("armed", [False, True])
def test_before_a_go_the_mode_is_touched_only_where_a_disarmed_px4_fails_its_checks_by_it(health, armed):
    rig = Rig("px4")
    sent = rig.run(2.0, beat("px4", armed=armed, mode=OFFBOARD), health, landed(1), acks=True)
    asked = {call for call in sent if call[0] == mavlink.MAV_CMD_DO_SET_MODE}
    assert asked == (
        {(mavlink.MAV_CMD_DO_SET_MODE, (1.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0))}
        if health is ILL and not armed
        else set()
    )
    assert ("OFFBOARD" in rig.pilot.waiting_for) == bool(asked)
    assert not rig.pilot.streaming
    # Nor in another mode.
    for flavour, mode in (("px4", HOLD), ("px4", 3 << 16), ("ardupilot", 4), ("ardupilot", 9)):
        rig = Rig(flavour)
        sent = rig.run(2.0, beat(flavour, mode=mode), ILL, landed(1))
        assert mavlink.MAV_CMD_DO_SET_MODE not in {command for command, _ in sent}
        assert rig.pilot.waiting_for == "the autopilot's pre-arm checks"


@pytest.mark.parametrize("blind", [None, state(HEIGHT, age=500_001)], ids=["nothing", "old"])
def test_who_is_blind_lands_without_settling(blind):
    rig = Rig().escorting()
    rig.pilot.land()
    rig.view = READY._replace(own=blind)
    sent = rig.run(0.1, beat("ardupilot", armed=True, guided=True))
    assert [command for command, _ in sent] == [mavlink.MAV_CMD_NAV_LAND]


def test_settling_ends():
    rig = Rig().escorting()
    rig.pilot.land()
    longest = CompanionConfig().guard.settle_us * 1e-6
    flying = beat("ardupilot", armed=True, guided=True)
    sent = rig.run(longest - 0.1, flying)
    assert {(command, params[0]) for command, params in sent} == {ORIGIN_REQUEST}
    assert [command for command, _ in rig.run(0.2, flying)] == [mavlink.MAV_CMD_NAV_LAND]


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_landing_goes_through_settling_and_ends_disarmed(flavour):
    rig = Rig(flavour).escorting()
    flying = beat(flavour, armed=True, guided=True)
    assert rig.pilot.land()
    assert rig.pilot.phase is Phase.SETTLE
    # Until it has settled it is steered, and nothing is ordered.
    assert rig.run(3.0, flying) == []
    assert rig.pilot.streaming
    rig.pilot.settled()
    assert not rig.pilot.streaming
    sent = rig.run(1.0, flying)
    assert [command for command, _ in sent] == [mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_LAND]
    landing = beat(flavour, armed=True, mode=min(PROFILES[flavour].land_modes))
    assert rig.run(40.0, landing, acks=True) == []
    assert rig.pilot.phase is Phase.LAND
    rig.run(2.6, beat(flavour), landed(1))
    assert rig.pilot.phase is Phase.DONE
    assert rig.run(5.0, beat(flavour)) == []


@pytest.mark.parametrize("phase", [p for p in Phase if p is not Phase.SETTLE])
def test_only_who_settles_can_have_settled(phase):
    rig = Rig()
    rig.pilot.phase = phase
    rig.pilot.settled()
    assert rig.pilot.phase is phase


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_hold_come_back_and_go_on(flavour):
    rig = Rig(flavour).escorting()
    flying = beat(flavour, armed=True, guided=True)
    pilot = rig.pilot
    for order, phase in (
        (pilot.hold, Phase.HOLD),
        (pilot.come_back, Phase.RETURN),
        (lambda: pilot.go(HEIGHT), Phase.ESCORT),
        (pilot.come_back, Phase.RETURN),
        (pilot.hold, Phase.HOLD),
    ):
        assert order()
        assert pilot.phase is phase
        assert rig.run(1.0, flying) == []
        assert pilot.streaming
    pilot.returned()
    assert pilot.phase is Phase.HOLD
    assert pilot.come_back()
    pilot.returned()
    assert pilot.phase is Phase.SETTLE
    assert not pilot.hold()
    np.testing.assert_array_equal(pilot.start, [0.0, 0.0, GROUND])


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_height_that_drifts_does_not_hold_up_the_take_off(flavour):
    """The estimate says 0.8 m less than was asked for; the autopilot is where it wants to be."""
    rig = Rig(flavour).prepared()
    armed = beat(flavour, armed=True, guided=flavour == "ardupilot")
    rig.run(1.0, armed, landed(1), acks=True)
    rig.view = READY._replace(own=state(HEIGHT - 0.8))
    before = len(rig.sent)
    rig.run(1.5, armed, landed(2), acks=True)
    assert rig.pilot.phase is Phase.PREPARE
    rig.run(2.0, armed, landed(2), acks=True)
    rig.run(1.0, beat(flavour, armed=True, guided=True), landed(2), acks=True)
    assert rig.pilot.phase is Phase.ESCORT
    assert mavlink.MAV_CMD_NAV_TAKEOFF not in {command for _, command, _ in rig.sent[before:]}


def test_a_refusal_that_is_but_repeated_counts_once():
    calls, now = Commands(OWN), 0

    def refused(result):
        nonlocal now
        now += 1_000_000
        assert calls.call(now, mavlink.MAV_CMD_DO_SET_MODE, (1.0,) * 7)
        calls.receive(ack(mavlink.MAV_CMD_DO_SET_MODE, result))
        return calls.refused

    assert {refused(4) for _ in range(100)} == {1}
    assert list(calls.refusals) == [f"command {mavlink.MAV_CMD_DO_SET_MODE}: result 4"]
    assert refused(2) == 2
    calls.forget()
    assert refused(2) == 3
    for result in (1, 2) * 100:
        refused(result)
    assert len(calls.refusals) <= 16


@pytest.mark.parametrize(("system", "component"), [(255, 190), (OWN.system, 1)])
def test_an_answer_to_somebody_else_settles_nothing(system, component):
    rig = Rig("ardupilot")
    rig.prepared()
    rig.run(0.1, beat("ardupilot"), HEALTHY)
    rig.tick(ack(mavlink.MAV_CMD_DO_SET_MODE)._replace(target_system=system, target_component=component))
    assert mavlink.MAV_CMD_DO_SET_MODE in {command for command, _ in rig.run(2.0, beat("ardupilot"), HEALTHY)}
    # MAVLink 1 does not say whom it answers.
    rig.tick(ack(mavlink.MAV_CMD_DO_SET_MODE)._replace(target_system=0, target_component=0))
    assert mavlink.MAV_CMD_DO_SET_MODE not in {
        command for command, _ in rig.run(2.0, beat("ardupilot"), HEALTHY)
    }


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("seen", [True, False])
def test_an_escort_begins_on_the_way_up_where_its_target_is_known(flavour, seen):
    rig = Rig(flavour).prepared()
    armed = beat(flavour, armed=True, guided=flavour == "ardupilot")
    rig.run(1.0, armed, landed(1), acks=True)
    climbing = state(0.7 * HEIGHT)._replace(velocity=np.array([0.0, 0.0, 1.2]))
    rig.view = READY._replace(own=climbing, target=state(0.0) if seen else None)
    rig.run(0.5, armed, landed(3), acks=True)
    rig.run(0.5, beat(flavour, armed=True, guided=True), landed(3), acks=True)
    assert (rig.pilot.phase is Phase.ESCORT) is seen


@pytest.mark.parametrize("taken", [True, False])
def test_plans_begin_when_the_mode_is_taken_and_end_when_no_heartbeat_shows_it(taken):
    rig = Rig("px4").prepared()
    armed = beat("px4", armed=True, guided=False)
    rig.run(1.0, armed, landed(1), acks=True)
    rig.view = READY._replace(own=state(HEIGHT))
    rig.run(0.3, armed, landed(2), acks=taken)
    assert rig.pilot.streaming
    assert not rig.pilot.guided
    assert rig.pilot.steers(rig.now) is taken
    assert not rig.pilot.steers(rig.now + 2_000_000)


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("acks", [False, True])
def test_the_origin_is_asked_for_in_flight_every_ten_seconds_and_soon_after_it_changes(flavour, acks):
    """The message about a new one may be lost, and one that came may have been an old copy."""
    rig = Rig(flavour).escorting()
    rig.run(1.0, beat(flavour, armed=True, guided=True), IN_FLIGHT, acks=acks)
    rig.sent.clear()
    rig.run(60.0, beat(flavour, armed=True, guided=True), IN_FLIGHT, acks=acks)
    asked = [at for at, command, params in rig.sent if (command, params[0]) == ORIGIN_REQUEST]
    assert len(asked) == 6
    assert {b - a for a, b in pairwise(asked)} == {10_000_000}
    rig.view = rig.view._replace(local=FLEET.local(FLEET.latitude + 1e-5, FLEET.longitude, FLEET.altitude))
    rig.sent.clear()
    changed = rig.now
    rig.run(3.0, beat(flavour, armed=True, guided=True), IN_FLIGHT, acks=acks)
    (asked,) = (at for at, command, params in rig.sent if (command, params[0]) == ORIGIN_REQUEST)
    # Within two seconds the answer would be taken for an old copy.
    assert 2_000_000 < asked - changed < 2_300_000


def test_nothing_is_asked_of_a_vehicle_that_another_controller_flies():
    rig = Rig("px4").escorting()
    rig.run(1.0, beat("px4", armed=True, guided=True), IN_FLIGHT)
    rig.run(0.1, beat("px4", armed=True, mode=3 << 16), IN_FLIGHT)
    assert rig.pilot.phase is Phase.YIELDED
    sent = rig.run(30.0, beat("px4", armed=True, mode=3 << 16), IN_FLIGHT)
    assert ORIGIN_REQUEST not in {(command, params[0]) for command, params in sent}


@pytest.mark.parametrize(
    ("least", "floor"), [(None, 1.0), (0.2, GROUND + 0.2), (4.0, GROUND + 4.0), (90.0, 76.0)]
)
def test_the_floor_is_above_the_take_off_where_that_is_asked_for(least, floor):
    """Three quarters of the box at most, so that a vehicle finds room."""
    limits = {"box_min": (-9.0, -9.0, 1.0), "box_max": (9.0, 9.0, 101.0)}
    config = CompanionConfig.model_validate({"guard": {"least_height": least}, "limits": limits})
    rig = Rig()
    rig.pilot = Pilot(config, OWN, FLEET.altitude)
    assert rig.pilot.lowered.limits.box_min[2] == 1.0
    rig.escorting()
    assert rig.pilot.lowered.limits.box_min == (-9.0, -9.0, pytest.approx(floor))
    assert rig.pilot.lowered is rig.pilot.lowered
    assert rig.pilot.planned_limits is rig.pilot.lowered.limits


def test_a_vehicle_that_is_taken_over_in_flight_has_no_floor_above_its_take_off():
    rig = Rig()
    rig.pilot = Pilot(CompanionConfig.model_validate({"guard": {"least_height": 3.0}}), OWN, FLEET.altitude)
    rig.view = READY._replace(own=state(HEIGHT))
    flying = beat(rig.flavour, armed=True, guided=True), IN_FLIGHT
    rig.run(0.2, *flying, HEALTHY, acks=True)
    assert rig.pilot.go(HEIGHT)
    rig.run(0.2, *flying)
    assert rig.pilot.phase is Phase.ESCORT
    assert rig.pilot.lowered is rig.pilot.limits.lowered
