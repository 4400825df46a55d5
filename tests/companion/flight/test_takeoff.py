"""The way into the air, for both autopilots, driven by messages as a table."""

from __future__ import annotations

import random
from typing import NamedTuple

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.flight.command_protocol import Commands
from companion.values.phase import Phase
from companion.world import View
from mavlink_bridge.messages import Message
from tests.companion.bench import FLAVOURS, FLEET, ORIGIN_REQUEST, TICK
from tests.companion.flight.rig import (
    GROUND,
    HALF,
    HEALTHY,
    HEIGHT,
    ILL,
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
    assert rig.pilot.commands.refusals
    assert set(rig.pilot.commands.refusals) == {f"command {mavlink.MAV_CMD_DO_SET_MODE}: result 4"}
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
    assert not rig.pilot.commands.refusals


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
