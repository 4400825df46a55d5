"""The way into the air and back, for both autopilots, driven by messages as a table."""

from __future__ import annotations

import math
import random
from typing import NamedTuple

import numpy as np
import pytest
from companion_bench import (
    ARM,
    ARMED,
    AUTOPILOT,
    FLEET,
    INTERVAL,
    LAND,
    MODE,
    PREARM_OK,
    PROFILES,
    REQUEST,
    START,
    TAKEOFF,
    TICK,
)

from companion.config import CompanionConfig
from companion.pilot import Phase, Pilot
from companion.tracks import State
from companion.world import View
from mavlink_bridge.messages import CommandAck, ExtendedSysState, Heartbeat, Message, Source, SysStatus

OWN = Source(11, 195)
HEIGHT, GROUND = 6.0, 2.5
HALF = 500_000
LOCAL = FLEET.local(FLEET.latitude, FLEET.longitude, FLEET.altitude)
FLAVOURS = tuple(PROFILES)
IN_FLIGHT = ExtendedSysState(AUTOPILOT, 0, 2)
HEALTHY = SysStatus(AUTOPILOT, PREARM_OK, PREARM_OK, PREARM_OK, None, None)
ILL = SysStatus(AUTOPILOT, PREARM_OK, PREARM_OK, 0, None, None)


def state(height=0.0, speed=0.0, age=5_000):
    return State(np.array([0.0, 0.0, GROUND + height]), np.array([0.0, 0.0, speed]), age)


def beat(flavour, armed=False, guided=False, autopilot=None, mode=0):
    profile = PROFILES[flavour]
    mode = profile.guided_custom_mode if guided else mode
    kind = profile.autopilot if autopilot is None else autopilot
    return Heartbeat(AUTOPILOT, 2, kind, ARMED * armed, mode, 4)


def ack(command, result=0):
    return CommandAck(AUTOPILOT, command, result, 0, 0, *OWN)


def landed(state_of_landing):
    return ExtendedSysState(AUTOPILOT, 0, state_of_landing)


NOTHING = View(None, None, None, None)
READY = View(state(), 0.3, None, LOCAL)


class Rig:
    """A pilot, the time, and what it sees and has sent."""

    def __init__(self, flavour="ardupilot", view=READY):
        self.flavour = flavour
        self.pilot = Pilot(CompanionConfig(), OWN, FLEET.altitude)
        self.now, self.view = START, view
        self.sent = []

    def tick(self, *heard: Message):
        """One step: the commands sent, as (command, parameters without NaN)."""
        for message in heard:
            # As a codec makes it: a new one each time.
            self.pilot.hear(message._replace())
        sent = [
            (m.command, tuple(p for p in m.params if p == p)) for m in self.pilot.step(self.now, self.view)
        ]
        self.sent += [(self.now, *call) for call in sent]
        self.now += TICK
        return sent

    def run(self, seconds, *every, acks=False):
        """Steps; with ``acks`` every command is accepted at once."""
        sent, answers = [], []
        for _ in range(round(seconds * 1e6 / TICK)):
            new = self.tick(*every, *answers)
            answers = [ack(command) for command, _ in new] if acks else []
            sent += new
        return sent

    def prepared(self):
        """Connected, given the go, intervals asked for."""
        self.run(0.2, beat(self.flavour), HEALTHY, acks=True)
        assert self.pilot.go(HEIGHT)
        self.tick()
        assert self.pilot.phase is Phase.PREPARE
        return self

    def escorting(self):
        self.prepared()
        self.view = READY._replace(own=state(HEIGHT))
        self.run(0.2, beat(self.flavour, armed=True, guided=True))
        assert self.pilot.phase is Phase.ESCORT
        return self


class Want(NamedTuple):
    """What is known to the pilot, what it must then name as missing ("": nothing is), and whether the
    autopilot answers its requests."""

    heard: tuple[Message, ...]
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
    sent = rig.run(3.0, *want.heard, acks=want.answers)
    if want.missing:
        assert rig.pilot.phase is Phase.CONNECT
        assert want.missing in rig.pilot.waiting_for
        assert {command for command, _ in sent} <= {INTERVAL, REQUEST}
        assert not rig.pilot.streaming
    else:
        assert rig.pilot.phase is Phase.PREPARE


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_nothing_is_armed_without_a_go(flavour):
    rig = Rig(flavour)
    sent = rig.run(20.0, beat(flavour), HEALTHY, acks=True)
    assert {command for command, _ in sent} == {INTERVAL, REQUEST}
    assert rig.pilot.phase is Phase.CONNECT


ORDER = {
    # Command, parameters, what it waits for, whether set-points flow once it is done.
    "ardupilot": (
        (MODE, (1.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0), "guided mode", False),
        (ARM, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), "arm", False),
        (TAKEOFF, (0.0, 0.0, 0.0, HEIGHT), "take-off", True),
    ),
    "px4": (
        (ARM, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), "arm", False),
        # PX4 wants its take-off altitude above mean sea level.
        (TAKEOFF, (0.0, 0.0, 0.0, FLEET.altitude + GROUND + HEIGHT), "take-off", True),
        (MODE, (1.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0), "guided mode", True),
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
        assert rig.pilot.streaming == (flavour == "px4" and command == MODE)
        if command == TAKEOFF:
            for height, speed in ((0.5 * HEIGHT, 1.0), (HEIGHT, 1.0), (0.5 * HEIGHT, 0.0)):
                rig.view = READY._replace(own=state(height, speed))
                assert rig.run(0.5, beat(flavour, armed, guided)) == []
            rig.view = READY._replace(own=state(HEIGHT))
        armed, guided = armed or command == ARM, guided or command == MODE
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
        rig.tick(beat("ardupilot"), *[ack(MODE, 4)] * (rig.now % HALF == 0))
    assert rig.pilot.refusals
    assert set(rig.pilot.refusals) == {f"command {MODE}: result 4"}
    assert len([1 for _, command, _ in rig.sent if command == MODE]) >= 3


def test_an_acknowledgement_of_something_else_settles_nothing():
    rig = Rig().prepared()
    rig.run(0.6, beat("ardupilot"))
    rig.tick(ack(ARM), ack(TAKEOFF), ack(INTERVAL))
    assert rig.run(1.0, beat("ardupilot"))
    assert rig.pilot.refusals == []


@pytest.mark.parametrize("seed", range(5))
def test_every_stream_is_asked_for_until_the_autopilot_has_heard_it(seed):
    """Half of the requests and a third of the answers are lost; an acknowledgement names no stream."""
    lossy = random.Random(seed)
    rig = Rig(view=READY._replace(local=None))
    heard, answers = set(), []
    for _ in range(3000):
        new = rig.tick(beat("ardupilot"), *answers)
        arrived = [call for call in new if lossy.random() > 0.5]
        heard |= {params[0] for command, params in arrived if command == INTERVAL}
        answers = [ack(command) for command, _ in arrived if lossy.random() > 0.33]
    assert heard == {32.0, 30.0, 1.0, 245.0}


def test_an_autopilot_that_answers_no_request_is_asked_for_every_stream():
    rig = Rig(view=NOTHING)
    sent = rig.run(4.0, beat("ardupilot"))
    assert {params[0] for command, params in sent if command == INTERVAL} == {32.0, 30.0, 1.0, 245.0}
    assert any(command == REQUEST and params[0] == 49.0 for command, params in sent)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_command_without_effect_is_asked_again_though_acknowledged(flavour):
    rig = Rig(flavour).escorting()
    rig.pilot.land()
    rig.pilot.settled()
    rig.sent.clear()
    rig.run(40.0, beat(flavour, armed=True, guided=True), acks=True)
    times = [now for now, command, _ in rig.sent if command == LAND]
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
    Order(Phase.CONNECT, "land", 0.0, True, Phase.CONNECT),
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


def test_an_order_to_land_takes_an_earlier_go_back():
    rig = Rig(view=READY._replace(local=None))
    assert rig.pilot.go(HEIGHT)
    assert rig.pilot.land()
    rig.view = READY
    assert {command for command, _ in rig.run(5.0, BEAT, HEALTHY, acks=True)} == {INTERVAL, REQUEST}
    assert rig.pilot.phase is Phase.CONNECT


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_without_a_heartbeat_for_three_seconds_nothing_is_steered(flavour):
    rig = Rig(flavour).escorting()
    rig.run(2.9)
    assert rig.pilot.streaming
    rig.run(0.2)
    assert not rig.pilot.streaming
    rig.tick(beat(flavour, armed=True, guided=True))
    assert rig.pilot.streaming


@pytest.mark.parametrize("blind", [None, state(HEIGHT, age=500_001)], ids=["nothing", "old"])
def test_who_is_blind_lands_without_settling(blind):
    rig = Rig().escorting()
    rig.pilot.land()
    rig.view = READY._replace(own=blind)
    sent = rig.run(0.1, beat("ardupilot", armed=True, guided=True))
    assert [command for command, _ in sent] == [LAND]


def test_settling_ends():
    rig = Rig().escorting()
    rig.pilot.land()
    longest = CompanionConfig().guard.settle_us * 1e-6
    flying = beat("ardupilot", armed=True, guided=True)
    assert rig.run(longest - 0.1, flying) == []
    assert [command for command, _ in rig.run(0.2, flying)] == [LAND]


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
    assert [command for command, _ in sent] == [LAND, LAND]
    landing = beat(flavour, armed=True, mode=min(PROFILES[flavour].land_modes))
    assert rig.run(40.0, landing, acks=True) == []
    assert rig.pilot.phase is Phase.LAND
    rig.tick(beat(flavour))
    assert rig.pilot.phase is Phase.DONE
    assert rig.run(5.0, beat(flavour)) == []


@pytest.mark.parametrize("phase", [p for p in Phase if p is not Phase.SETTLE])
def test_only_who_settles_can_have_settled(phase):
    rig = Rig()
    rig.pilot.phase = phase
    rig.pilot.settled()
    assert rig.pilot.phase is phase


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


# A pilot on the way up and down


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
    assert MODE in {command for command, _ in rig.run(5.0, held, landed(2))}


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
    assert not {command for command, _ in sent} & {ARM, MODE, TAKEOFF}
    assert rig.pilot.waiting_for == "the operator's go"


@pytest.mark.parametrize("mode", [0, 3 << 16, HOLD["px4"]])
def test_what_happened_while_nothing_was_heard_may_have_been_a_pilot(mode):
    rig = Rig("px4").escorting()
    rig.pilot.streamed(rig.now)
    rig.run(4.0)
    assert rig.run(10.0, beat("px4", armed=True, mode=mode)) == []
    assert rig.pilot.phase is Phase.YIELDED


# A go does not keep


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_go_that_came_too_early_is_forgotten(flavour):
    rig = Rig(flavour)
    assert rig.pilot.go(HEIGHT)
    rig.run(30.5, beat(flavour), ILL, acks=True)
    sent = rig.run(30.0, beat(flavour), HEALTHY, acks=True)
    assert not {command for command, _ in sent} & {ARM, MODE, TAKEOFF}
    assert rig.pilot.waiting_for == "the operator's go"


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_vehicle_that_does_not_arm_is_not_told_to_for_ever(flavour):
    rig = Rig(flavour).prepared()
    guided = beat(flavour, guided=flavour == "ardupilot")
    rig.run(31.0, guided, HEALTHY, ack(ARM, result=4))
    rig.sent.clear()
    rig.run(60.0, guided, HEALTHY, ack(ARM, result=4))
    assert not {command for _, command, _ in rig.sent} & {ARM, MODE, TAKEOFF}


# Where it may start


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
    assert (ARM in {command for command, _ in sent}) == allowed
    assert allowed or "a start near the box" in rig.pilot.waiting_for


@pytest.mark.parametrize("left", [0.19, 0.02])
def test_with_a_low_battery_nothing_starts(left):
    rig = Rig("px4")
    low = HEALTHY._replace(battery_remaining=left)
    assert rig.pilot.go(HEIGHT)
    sent = rig.run(5.0, beat("px4"), low, acks=True)
    assert ARM not in {command for command, _ in sent}
    assert rig.pilot.waiting_for == "a battery above 20 %"


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_new_go_takes_the_vehicle_back_in_flight_and_asks_for_the_mode_alone(flavour):
    rig = Rig(flavour).escorting()
    rig.run(5.0, beat(flavour, armed=True), HEALTHY, IN_FLIGHT)
    assert rig.pilot.phase is Phase.YIELDED
    assert rig.pilot.go(HEIGHT)
    sent = rig.run(3.0, beat(flavour, armed=True), HEALTHY, IN_FLIGHT, acks=True)
    assert {command for command, _ in sent} == {INTERVAL, REQUEST, MODE}
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
    assert {command for command, _ in sent} == {INTERVAL, REQUEST}
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
    assert [command for command, _ in sent] == [MODE]
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
    assert {command for command, _ in sent} == {MODE}
    assert rig.pilot.phase is Phase.YIELDED


def test_a_switch_to_a_mode_of_a_pilot_is_no_accident_even_after_a_gap():
    rig = Rig("px4").escorting()
    rig.pilot.streamed(rig.now)
    rig.now += 2_000_000
    manual = beat("px4", armed=True)._replace(custom_mode=1 << 16)
    assert rig.tick(manual) == []
    assert rig.pilot.phase is Phase.YIELDED


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
def test_an_order_to_land_before_the_start_takes_the_go_back(flavour):
    rig = Rig(flavour, NOTHING)
    assert rig.pilot.go(6.0)
    assert rig.pilot.land()
    rig.view = READY
    rig.run(5.0, beat(flavour), HEALTHY, acks=True)
    assert rig.pilot.phase is Phase.CONNECT
    assert rig.pilot.waiting_for == "the operator's go"


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
def test_disarmed_on_the_way_up_it_does_not_arm_again_without_a_new_go(flavour):
    rig = Rig(flavour).prepared()
    rig.run(1.0, beat(flavour, armed=True, guided=True), acks=True)
    assert rig.pilot.phase is Phase.PREPARE
    sent = rig.run(20.0, beat(flavour), HEALTHY, acks=True)
    assert ARM not in {command for command, _ in sent}
    assert rig.pilot.phase is Phase.CONNECT
    assert rig.pilot.waiting_for == "the operator's go"


# A vehicle that flies already


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("airborne", [2, 3, 4], ids=["in the air", "taking off", "landing"])
def test_who_may_be_flying_is_never_told_to_take_off(flavour, airborne):
    rig = Rig(flavour, READY._replace(own=state(8.0)))
    assert rig.pilot.go(HEIGHT)
    every = beat(flavour, armed=True, guided=True), HEALTHY, landed(airborne)
    sent = rig.run(4.0, *every, acks=True)
    assert rig.pilot.phase is Phase.ESCORT
    assert not {command for command, _ in sent} & {TAKEOFF, ARM}


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("heard", [(), (landed(0),)], ids=["nothing said", "undefined"])
def test_an_armed_vehicle_of_which_nobody_says_where_it_is_is_left_alone(flavour, heard):
    rig = Rig(flavour, READY._replace(own=state(8.0)))
    assert rig.pilot.go(HEIGHT)
    sent = rig.run(4.0, beat(flavour, armed=True, guided=True), HEALTHY, *heard, acks=True)
    assert rig.pilot.phase is Phase.CONNECT
    assert "EXTENDED_SYS_STATE" in rig.pilot.waiting_for
    assert not {command for command, _ in sent} & {TAKEOFF, ARM}


def test_what_was_said_of_landing_long_ago_is_forgotten():
    rig = Rig()
    rig.run(0.2, beat("ardupilot", armed=True), HEALTHY, landed(2), acks=True)
    rig.run(4.0, beat("ardupilot", armed=True), HEALTHY, acks=True)
    assert rig.pilot.go(HEIGHT)
    rig.run(1.0, beat("ardupilot", armed=True), HEALTHY, acks=True)
    assert "EXTENDED_SYS_STATE" in rig.pilot.waiting_for


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
    assert TAKEOFF not in {command for _, command, _ in rig.sent[before:]}
