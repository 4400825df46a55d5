"""What is wrong, from when on, and what follows: each concern at its limit, alone and in flight."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.estimation.tracks import State
from companion.flight.guard import Holding
from companion.flight.health_monitor import HealthInputs, HealthMonitor, Reaction
from companion.flight.vehicle import Vehicle
from companion.values.phase import Phase
from companion.values.refused_senders import RefusedSenders
from companion.world import View
from mavlink_bridge.messages import (
    CommandLong,
    GpsGlobalOrigin,
    Heartbeat,
    SetpointLocal,
    StatusText,
    SysStatus,
)
from tests.companion.bench import AUTOPILOT, FLEET, NAN, PROFILES, Bench, only, seen_at

SECOND = 1_000_000
LOCAL = FLEET.local(FLEET.latitude, FLEET.longitude, FLEET.altitude)
HERE = State(np.array([1.0, 2.0, 5.0]), np.zeros(3), 5_000)
TARGET = State(np.zeros(3), np.zeros(3), 5_000)
CONFIG = CompanionConfig()
GUARD = CONFIG.guard


def vehicle(*, battery=None, state=4, now=SECOND):
    found = Vehicle()
    profile = PROFILES["ardupilot"]
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    found.receive(Heartbeat(AUTOPILOT, 2, profile.autopilot, armed, profile.guided_custom_mode, state))
    checks = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    found.receive(SysStatus(AUTOPILOT, checks, checks, checks, 12.0, battery))
    found.tick(now)
    return found


def situation(**changes):
    view = View(HERE, 0.3, TARGET, LOCAL)
    good = HealthInputs(SECOND, view, Phase.ESCORT, vehicle(), Holding.FRESH, {12: 0}, None, 0, 0)
    return good._replace(**changes)


def own(age=5_000, position=(1.0, 2.0, 5.0)):
    return View(State(np.array(position), np.zeros(3), age), 0.3, TARGET, LOCAL)


FENCED = CompanionConfig(guard=GUARD.model_copy(update={"fence_radius": 20.0, "fence_height": 30.0}))
TELL, RETURN, TO_LAND = Reaction.TELL, Reaction.RETURN, Reaction.LAND
LIMITS = {
    "an old own state": (
        "own",
        {"view": own(GUARD.own_stale_us)},
        {"view": own(GUARD.own_stale_us + 1)},
        TELL,
    ),
    "a lost own state": (
        "own",
        {"view": own(GUARD.own_lost_us)},
        {"view": own(GUARD.own_lost_us + 1)},
        TO_LAND,
    ),
    "no plan": ("solver", {"failing": SECOND - GUARD.hold_us}, {"failing": SECOND - GUARD.hold_us - 1}, TELL),
    "no plan for long": (
        "solver",
        {"now": 9 * SECOND, "failing": 9 * SECOND - GUARD.unsolved_us},
        {"now": 9 * SECOND, "failing": 9 * SECOND - GUARD.unsolved_us - 1},
        TO_LAND,
    ),
    "a low battery": (
        "battery",
        {"vehicle": vehicle(battery=GUARD.battery_low)},
        {"vehicle": vehicle(battery=GUARD.battery_low - 0.01)},
        RETURN,
    ),
    "a critical battery": (
        "battery",
        {"vehicle": vehicle(battery=GUARD.battery_critical)},
        {"vehicle": vehicle(battery=GUARD.battery_critical - 0.01)},
        TO_LAND,
    ),
    "a failsafe": ("failsafe", {"vehicle": vehicle(state=4)}, {"vehicle": vehicle(state=5)}, TELL),
    "a silent neighbour": (
        "neighbour",
        {"neighbours": {12: GUARD.neighbour_lost_us}},
        {"neighbours": {12: GUARD.neighbour_lost_us + 1}},
        TELL,
    ),
    "the fence's radius": (
        "fence",
        {"view": own(position=(12.0, -16.0, 5.0))},
        {"view": own(position=(12.0, -16.1, 5.0))},
        RETURN,
    ),
    "the fence's height": (
        "fence",
        {"view": own(position=(0.0, 0.0, 30.0))},
        {"view": own(position=(0.0, 0.0, 30.1))},
        RETURN,
    ),
    "a late step": ("lateness", {"late": GUARD.late_us}, {"late": GUARD.late_us + 1}, TELL),
    "a jump of the clock": ("clock", {"clock_steps": 0}, {"clock_steps": 1}, TELL),
    "a clock that loses a percent": ("slow", {"clock_lost": 0}, {"clock_lost": 100_001}, TELL),
    "late messages": ("late", {}, {"unanswered": True}, TELL),
    "an origin that moved": ("origin", {}, {"moves": 1, "displaced": GUARD.displaced}, TELL),
    "a jump with the origin": (
        "origin",
        {},
        {"moves": 1, "displaced": GUARD.displaced + 0.1},
        TO_LAND,
    ),
    "a jump to nowhere": ("origin", {}, {"moves": 1, "displaced": math.nan}, TO_LAND),
    "plans in another frame": ("foreign", {}, {"refused": RefusedSenders(foreign=(12,))}, TELL),
    "another fleet file": ("differing", {}, {"refused": RefusedSenders(differing=(12,))}, TELL),
    "a wrong clock": ("peer", {}, {"refused": RefusedSenders(wrong_clock=(12,))}, TELL),
    "two vehicles with an id": ("doubled", {}, {"refused": RefusedSenders(doubled=(12,))}, TELL),
    "no way to the destination": ("enclosed", {}, {"enclosed": True}, TELL),
    "who took it over": ("custody", {"phase": Phase.ESCORT}, {"phase": Phase.YIELDED}, TELL),
}


@pytest.mark.parametrize("name", LIMITS)
def test_a_concern_begins_at_its_limit_is_said_once_and_ends(name):
    concern, good, bad, reaction = LIMITS[name]
    watch = HealthMonitor(FENCED)
    before = watch.look(situation(**good))
    begun = [change for change in watch.look(situation(**bad)) if change.begins]
    assert [change.concern.name.split()[0] for change in begun] == [concern]
    assert begun[0].concern.reaction is reaction
    assert len(begun[0].concern.text) <= 50
    assert watch.look(situation(**bad)) == []
    # What began with the good one, if anything, was a milder form of the same.
    assert all(change.concern.name.split()[0] == concern for change in before)
    later = situation(
        now=60 * SECOND,
        vehicle=vehicle(now=60 * SECOND),
        clock_steps=bad.get("clock_steps", 0),
        moves=bad.get("moves", 0),
        clock_lost=bad.get("clock_lost", 0),
    )
    assert {change.begins for change in watch.look(later)} == {False}
    assert watch.concerns == {}


@pytest.mark.parametrize("phase", [Phase.CONNECT, Phase.DONE])
def test_on_the_ground_nothing_of_a_flight_concerns_it(phase):
    watch = HealthMonitor(FENCED)
    for _, _, bad, _ in LIMITS.values():
        if "phase" not in bad and not {"late", "clock_steps", "neighbours", "refused"} & set(bad):
            assert watch.look(situation(**{**bad, "phase": phase})) == []


def test_a_slow_clock_is_said_once_however_its_losses_are_spread():
    for share, every, said in ((0.06, 0.1, 1), (0.0101, 0.1, 1), (0.05, 7.0, 1), (0.002, 0.1, 0)):
        watch, begun = HealthMonitor(CONFIG), 0
        for k in range(900):
            lost = round(1e6 * share * every * (0.1 * k // every))
            at = SECOND + 100_000 * k
            changes = watch.look(situation(now=at, vehicle=vehicle(now=at), clock_lost=lost))
            begun += sum(change.begins for change in changes)
        assert begun == said


# In flight


@pytest.fixture(params=["ardupilot", "px4"])
def flying(request):
    bench = Bench(request.param).take_off(5.0)
    bench.fly(0.5)
    return bench


def commands(sent):
    return [m.command for m in only(CommandLong, sent, "autopilot")]


def test_with_a_low_battery_it_comes_back_and_lands(flying):
    start = flying.autopilot.position.copy()
    flying.go_to([6.0, 3.0, 6.0])
    flying.fly(5.0)
    assert np.linalg.norm(flying.autopilot.position[:2] - start[:2]) > 4.0
    flying.autopilot.battery = 0.15
    flying.fly(15.0)
    assert flying.phase in (Phase.LAND, Phase.DONE)
    assert np.linalg.norm(flying.autopilot.position[:2] - start[:2]) < 0.6


def test_with_a_critical_battery_it_lands_where_it_is(flying):
    flying.go_to([6.0, 3.0, 6.0])
    flying.fly(5.0)
    here = flying.autopilot.position.copy()
    flying.autopilot.battery = 0.05
    sent = flying.fly(6.0)
    assert mavlink.MAV_CMD_NAV_LAND in commands(sent)
    assert np.linalg.norm(flying.autopilot.position[:2] - here[:2]) < 1.0


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
@pytest.mark.parametrize("left", [0.15, 0.05])
def test_what_begins_on_the_way_up_is_not_forgotten_at_the_top(flavour, left):
    bench = Bench(flavour)
    bench.fly(1.0)
    bench.order(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 5.0)
    while bench.phase is not Phase.PREPARE or not bench.autopilot.armed:
        bench.step()
    bench.autopilot.battery = left
    sent = bench.fly(15.0)
    assert mavlink.MAV_CMD_NAV_LAND in commands(sent)


def test_an_operator_may_go_on_in_spite_of_a_low_battery(flying):
    flying.go_to([6.0, 3.0, 6.0])
    flying.fly(5.0)
    flying.autopilot.battery = 0.15
    flying.fly(0.5)
    assert flying.phase is Phase.RETURN
    flying.order(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 5.0)
    flying.fly(5.0)
    assert flying.phase is Phase.ESCORT


def test_blind_for_long_it_is_told_to_land(flying):
    flying.autopilot.mute = True
    sent = flying.fly(GUARD.own_lost_us * 1e-6 - 0.5)
    assert mavlink.MAV_CMD_NAV_LAND not in commands(sent)
    sent = flying.fly(1.5)
    assert mavlink.MAV_CMD_NAV_LAND in commands(sent)


def test_blind_and_thrown_out_of_its_mode_it_is_told_to_land_all_the_same():
    """It hung, PX4 has left OFFBOARD meanwhile and does not take it back, and there is no position any
    more."""
    flying = Bench("px4").take_off(5.0)
    flying.fly(0.5)
    flying.autopilot.mute = True
    flying.now += 1_500_000
    sent = []
    for _ in range(500):
        flying.autopilot.mode = 4 << 16 | 3 << 24
        sent += commands(flying.step())
    assert mavlink.MAV_CMD_DO_SET_MODE in sent
    assert mavlink.MAV_CMD_NAV_LAND in sent
    assert mavlink.MAV_CMD_DO_SET_MODE not in sent[sent.index(mavlink.MAV_CMD_NAV_LAND) :]


def test_a_neighbour_that_is_silent_is_said_and_still_kept_away_from(flying):
    neighbour = flying.datagram("swarm", seen_at(12, [3.0, 0.0, 5.0]))
    flying.fly(1.0, neighbour)
    flying.fly(GUARD.neighbour_lost_us * 1e-6 + 0.5)
    assert "neighbour 12" in flying.companion.health.concerns
    flying.go_to([3.0, 0.0, 5.0])
    flying.fly(6.0)
    assert np.linalg.norm(flying.autopilot.position - [3.0, 0.0, 5.0]) > CONFIG.field.d_min
    assert only(SetpointLocal, flying.fly(0.5), "autopilot")


def test_the_ground_is_told_of_what_begins_and_of_what_is_over():
    bench = Bench(ground_messages={"texts": True}).take_off(5.0)
    bench.autopilot.battery = 0.15
    sent = bench.fly(2.0)
    texts = [m.text for m in only(StatusText, sent, "ground")]
    assert texts == ["Battery 15 %: coming back"]
    bench.autopilot.battery = 0.5
    texts = [m.text for m in only(StatusText, bench.fly(3.0), "ground")]
    assert texts == ["Over: Battery 15 %"]


def test_who_misses_a_neighbour_flies_about_slowly():
    guard = GUARD.model_copy(update={"cautious_speed": 1.0})
    bench = Bench(guard=guard.model_dump()).take_off(5.0)
    bench.fly(1.0, bench.datagram("swarm", seen_at(12, [0.0, 15.0, 5.0])))
    bench.fly(GUARD.neighbour_lost_us * 1e-6 + 0.5)
    assert bench.companion.health.blinkered
    bench.go_to([8.0, 0.0, 5.0])
    fastest = 0.0
    for _ in range(40):
        before = bench.autopilot.position.copy()
        bench.fly(0.1)
        fastest = max(fastest, float(np.linalg.norm(bench.autopilot.position - before)) / 0.1)
    assert 0.4 < fastest < 2.0


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("climbing", [False, True])
def test_whose_place_is_lost_lands_though_its_origin_has_moved_as_well(climbing, moved):
    """An estimator that begins anew and finds no place."""
    bench = Bench()
    if climbing:
        bench.order(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, 20.0)
        while bench.autopilot.position[2] < 3.0:
            bench.step()
    else:
        bench.take_off()
    bench.autopilot.mute = True
    if moved:
        origin = GpsGlobalOrigin(AUTOPILOT, FLEET.latitude + 1e-4, FLEET.longitude, FLEET.altitude, 0)
        bench.step(bench.datagram("autopilot", origin))
    lost = bench.now
    bench.until(Phase.LAND)
    assert 4_500_000 < bench.now - lost < 6_000_000
