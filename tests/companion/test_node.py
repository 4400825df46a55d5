"""The companion as a node: a whole flight through bytes, who may command it, and what it does when something
is lost."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.errors import SolverError
from companion.flight.guard import Holding
from companion.values.phase import Phase
from mavlink_bridge.messages import (
    Attitude,
    CommandAck,
    CommandLong,
    GlobalPosition,
    GpsGlobalOrigin,
    Heartbeat,
    LocalPosition,
    SetpointLocal,
    Source,
    Tunnel,
)
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, unpack
from tests.companion.bench import (
    AUTOPILOT,
    FLEET,
    GROUND,
    LINKS,
    NAN,
    PROFILES,
    START,
    SYSTEM,
    TARGET,
    Bench,
    field_of,
    numbers_of,
    only,
    seen_at,
)

FLAVOURS = tuple(PROFILES)
HOLDING = np.array([0.0, 0.0, 5.0])


def setpoints(sent):
    return only(SetpointLocal, sent)


def commands(sent):
    """What is asked of the autopilot beside messages."""
    return [
        m.command
        for m in only(CommandLong, sent)
        if m.command not in (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE)
    ]


def place(message):
    """ENU position of a set-point; the bench's local frame is the fleet's."""
    north, east, down = message.position
    return np.array([east, north, -down])


@pytest.fixture(params=FLAVOURS)
def flying(request):
    """In the air at 5 m, under control, for either autopilot."""
    bench = Bench(request.param).take_off(5.0)
    bench.fly(0.5)
    return bench


# A whole flight


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_flight_from_the_go_to_the_ground(flavour):
    bench = Bench(flavour)
    before = bench.fly(3.0)
    assert commands(before) == []
    assert setpoints(before) == []
    bench.take_off(5.0)
    goal = np.array([4.0, -3.0, 6.0])
    assert [ack.result for ack in bench.go_to(goal)] == [mavlink.MAV_RESULT_ACCEPTED]
    flown = bench.fly(6.0)
    np.testing.assert_allclose(bench.autopilot.position, goal, atol=0.1)
    assert commands(flown) == []
    assert len(setpoints(flown)) == 300
    assert [ack.result for ack in bench.order(mavlink.MAV_CMD_NAV_LAND)] == [mavlink.MAV_RESULT_ACCEPTED]
    assert bench.phase is Phase.SETTLE
    bench.until(Phase.LAND)
    landing = bench.until(Phase.DONE).fly(1.0)
    assert setpoints(landing) == []
    steps = {
        "ardupilot": [
            mavlink.MAV_CMD_DO_SET_MODE,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
            mavlink.MAV_CMD_NAV_TAKEOFF,
        ],
        "px4": [
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
            mavlink.MAV_CMD_NAV_TAKEOFF,
            mavlink.MAV_CMD_DO_SET_MODE,
        ],
    }[flavour]
    # PX4 would come back to OFFBOARD, where it cannot be armed.
    leaves = [mavlink.MAV_CMD_DO_SET_MODE] if flavour == "px4" else []
    assert commands((link, m) for _, link, m in bench.sent) == [*steps, mavlink.MAV_CMD_NAV_LAND, *leaves]
    assert bench.autopilot.mode != bench.autopilot.profile.guided_custom_mode


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_set_point_is_finite_and_continuous_all_the_way(flavour):
    bench = Bench(flavour).take_off(5.0)
    bench.go_to([6.0, 2.0, 7.0])
    bench.fly(3.0)
    bench.go_to([-6.0, 2.0, 4.0])
    bench.fly(3.0)
    bench.order(mavlink.MAV_CMD_NAV_LAND)
    bench.until(Phase.LAND)
    found = setpoints((link, m) for _, link, m in bench.sent)
    assert np.isfinite([numbers_of(m) for m in found]).all()
    steps = np.linalg.norm(np.diff([m.position for m in found], axis=0), axis=1)
    # 20 ms at the speed limit, by axis; more is a jump.
    assert steps.max() < 0.02 * 5.0 * math.sqrt(3.0)
    speeds = np.linalg.norm(np.diff([m.velocity for m in found], axis=0), axis=1)
    assert speeds.max() < 0.02 * bench.config.limits.a_total + 0.01


def test_the_same_bytes_in_give_the_same_bytes_out():
    outputs = []
    for _ in range(2):
        bench = Bench().take_off(5.0)
        bench.go_to([4.0, -3.0, 6.0])
        bench.fly(1.0, bench.datagram("swarm", seen_at(12, [2.0, -1.0, 5.5])))
        # As text: a NaN, as in a take-off, is not equal to itself.
        outputs.append(repr(bench.sent))
    assert outputs[0] == outputs[1]


def test_the_epoch_does_not_matter():
    """Two companions switched on at different times fly alike."""
    tracks = []
    for shift in (0, 3_600_000_000):
        bench = Bench()
        bench.now = START + shift
        bench.take_off(5.0).go_to([4.0, -3.0, 6.0])
        bench.fly(2.0)
        tracks.append([numbers_of(m) for m in setpoints((link, m) for _, link, m in bench.sent)])
    np.testing.assert_array_equal(tracks[0], tracks[1])


def test_an_escort_takes_its_place_on_the_circle_and_faces_the_target():
    bench = Bench(task="escort", start=(7.0, 0.0, 0.0))
    bench.target = seen_at(TARGET, [0.0, 0.0, 0.0])
    bench.take_off(5.0)
    bench.fly(8.0)
    surface = bench.config.surface
    here = bench.autopilot.position
    assert np.linalg.norm(here - surface.nearest(here)) < 0.1
    x, y = bench.autopilot.position[:2]
    assert math.remainder(bench.autopilot.yaw - math.atan2(-y, -x), math.tau) == pytest.approx(0.0, abs=0.05)


# Who may command


class OtherLinks:
    """Ways of not being entitled."""

    links = tuple(link for link in LINKS if link != "ground")


@pytest.mark.parametrize("link", OtherLinks.links)
@pytest.mark.parametrize("command", [mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_LAND])
def test_a_command_by_another_link_is_not_obeyed(flying, link, command):
    sent = flying.fly(
        1.0, flying.datagram(link, CommandLong(GROUND, SYSTEM, 195, command, 0, (0, 0, 0, 0, 0, 0, 9.0)))
    )
    assert commands(sent) == []
    assert only(CommandAck, sent, "ground") == []
    assert flying.phase is Phase.ESCORT


@pytest.mark.parametrize(("system", "component"), [(12, 195), (SYSTEM, 1), (0, 0), (255, 195), (SYSTEM, 0)])
def test_a_command_to_somebody_else_is_not_obeyed_nor_answered(flying, system, component):
    order = CommandLong(GROUND, system, component, mavlink.MAV_CMD_NAV_LAND, 0, (0.0,) * 7)
    sent = flying.step(flying.datagram("ground", order))
    assert only(CommandAck, sent, "ground") == []
    assert flying.phase is Phase.ESCORT


@pytest.mark.parametrize("component", [0, 100, 191, 195])
def test_other_components_of_the_vehicle_have_no_say(flying, component):
    """A camera's heartbeat is not the autopilot's, and a VIO's position not the vehicle's."""
    source = Source(SYSTEM, component)
    others = (Heartbeat(source, 30, 0, 0, 0, 4), LocalPosition(source, 0, (9.0, 9.0, 9.0), (0.0, 0.0, 0.0)))
    assert len(setpoints(flying.fly(1.0, flying.datagram("autopilot", *others)))) == 50
    np.testing.assert_allclose(flying.autopilot.position, HOLDING, atol=0.1)


def test_no_go_by_another_link_starts_anything():
    for link in OtherLinks.links:
        bench = Bench()
        order = CommandLong(GROUND, SYSTEM, 195, mavlink.MAV_CMD_NAV_TAKEOFF, 0, (0, 0, 0, 0, 0, 0, 5.0))
        assert commands(bench.fly(3.0, bench.datagram(link, order))) == []
        assert bench.phase is Phase.CONNECT


def test_every_command_is_acknowledged_to_its_sender():
    bench = Bench()
    table = [
        (mavlink.MAV_CMD_NAV_LAND, (), mavlink.MAV_RESULT_ACCEPTED),
        (mavlink.MAV_CMD_NAV_TAKEOFF, (0, 0, 0, NAN, NAN, NAN, NAN), mavlink.MAV_RESULT_DENIED),
        (mavlink.MAV_CMD_NAV_TAKEOFF, (0, 0, 0, NAN, NAN, NAN, 0.1), mavlink.MAV_RESULT_DENIED),
        (mavlink.MAV_CMD_NAV_TAKEOFF, (0, 0, 0, NAN, NAN, NAN, math.inf), mavlink.MAV_RESULT_DENIED),
        (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1,), mavlink.MAV_RESULT_UNSUPPORTED),
        (mavlink.MAV_CMD_DO_SET_MODE, (1, 4), mavlink.MAV_RESULT_UNSUPPORTED),
        (mavlink.MAV_CMD_DO_REPOSITION, (), mavlink.MAV_RESULT_UNSUPPORTED),
        (mavlink.MAV_CMD_NAV_TAKEOFF, (0, 0, 0, NAN, NAN, NAN, 5.0), mavlink.MAV_RESULT_ACCEPTED),
    ]
    for command, params, result in table:
        (ack,) = bench.order(command, *params)
        assert (ack.command, ack.result) == (command, result)
        assert (ack.target_system, ack.target_component) == GROUND
        assert ack.source == Source(SYSTEM, 195)


@pytest.mark.parametrize(
    ("x", "y", "z", "frame"),
    [
        (473_977_420, 85_455_940, NAN, 0),
        (473_977_420, 85_455_940, math.inf, 0),
        (473_977_420, 85_455_940, -math.inf, 0),
        (473_977_420, 85_455_940, 3e38, 0),
        (900_000_001, 85_455_940, 490.0, 0),
        (473_977_420, -1_800_000_001, 490.0, 0),
        (2_147_483_647, -2_147_483_648, 490.0, 0),
        (473_977_420, 85_455_940, 10.0, 3),
        (473_977_420, 85_455_940, 10.0, 6),
        (10, 10, -10.0, 1),
    ],
    ids=["NaN", "inf", "-inf", "huge", "lat", "lon", "both", "relative", "relative int", "local"],
)
def test_a_goal_that_is_no_place_is_denied_and_moves_nothing(flying, x, y, z, frame):
    assert [ack.result for ack in flying.reposition(x, y, z, frame)] == [mavlink.MAV_RESULT_DENIED]
    found = setpoints(flying.fly(2.0))
    assert np.isfinite([numbers_of(m) for m in found]).all()
    np.testing.assert_allclose(flying.autopilot.position, HOLDING, atol=0.1)


# What is lost


def test_a_stale_own_state_is_held_then_braked_and_flown_again_when_it_returns(flying):
    flying.go_to([15.0, 0.0, 5.0])
    flying.fly(1.5)
    guard = field_of(flying.companion).guard
    assert flying.autopilot.velocity[0] > 1.0
    flying.autopilot.mute = True
    states = []
    for _ in range(200):
        flying.step()
        states.append(guard.state)
    # Fresh until the state is stale, held for its time, then braked; in this order, never back.
    order = list(dict.fromkeys(states))
    assert order == [Holding.FRESH, Holding.HELD, Holding.BRAKING]
    limits = flying.config.guard
    assert abs(states.index(Holding.HELD) * 10_000 - limits.own_stale_us) <= 60_000
    assert abs(states.count(Holding.HELD) * 10_000 - limits.hold_us) <= 60_000
    # The set-points go on, and come to rest.
    found = setpoints(flying.fly(2.0))
    assert len(found) == 100
    np.testing.assert_allclose(found[-1].velocity, 0.0, atol=1e-6)
    flying.autopilot.mute = False
    flying.fly(8.0)
    assert guard.state is Holding.FRESH
    np.testing.assert_allclose(flying.autopilot.position, [15.0, 0.0, 5.0], atol=0.1)


def test_a_solver_failure_keeps_the_plan_then_brakes_and_is_counted(flying, monkeypatch):
    flying.go_to([15.0, 0.0, 5.0])
    flying.fly(1.5)
    companion, plan = flying.companion, flying.companion.flown

    def fail(*_):
        raise SolverError("PIQP_MAX_ITER_REACHED", 60)

    monkeypatch.setattr(field_of(companion).planner, "plan", fail)
    sent = flying.fly(0.4)
    assert companion.avoidance.state is Holding.HELD
    assert companion.flown is plan
    assert companion.tally.solver_failures == 8
    for message in setpoints(sent)[-1:]:
        lead = flying.now - 20_000 + flying.config.setpoint_lead_us
        np.testing.assert_allclose(place(message), plan.at(lead).position, atol=0.05)
    found = setpoints(flying.fly(3.0))
    assert companion.avoidance.state is Holding.BRAKING
    np.testing.assert_allclose(found[-1].velocity, 0.0, atol=1e-6)
    monkeypatch.undo()
    flying.fly(0.1)
    assert companion.avoidance.state is Holding.FRESH


def test_a_lost_target_is_followed_for_its_time_then_the_vehicle_hovers():
    bench = Bench(task="escort", start=(4.0, 0.0, 0.0))
    bench.target = seen_at(TARGET, [0.0, 0.0, 0.0])
    bench.take_off(5.0)
    bench.fly(2.0)
    bench.target = None
    stale = bench.config.guard.target_stale_us * 1e-6
    bench.fly(stale - 0.2)
    assert "target" not in bench.companion.health.concerns
    bench.fly(3.0)
    # It still plans, so that it keeps clear of the others where it stays.
    assert bench.companion.avoidance.state is Holding.FRESH
    assert "target" in bench.companion.health.concerns
    found = setpoints(bench.fly(1.0))
    assert len(found) == 50
    np.testing.assert_allclose(found[-1].velocity, 0.0, atol=0.02)
    bench.target = seen_at(TARGET, [0.0, 0.0, 0.0])
    bench.fly(1.0)
    assert "target" not in bench.companion.health.concerns


def test_without_any_target_an_escort_hovers():
    bench = Bench(task="escort").take_off(5.0)
    found = setpoints(bench.fly(3.0))
    np.testing.assert_allclose([place(m) for m in found], np.tile(HOLDING, (len(found), 1)), atol=0.1)


def test_out_of_the_tube_the_plan_starts_anew_where_the_vehicle_is(flying):
    flying.autopilot.position += np.array([2.0, 0.0, 0.0])
    before = flying.companion.tally.anchored_anew
    # The vehicle is held there, whatever it is told.
    held = flying.autopilot.position.copy()
    sent = []
    for _ in range(30):
        sent += flying.step()
        flying.autopilot.position = held.copy()
    assert flying.companion.tally.anchored_anew > before
    tube = flying.config.guard.tube
    assert np.linalg.norm(place(setpoints(sent)[-1]) - held) <= tube + 0.05


def test_whatever_speed_it_is_measured_at_nothing_faster_than_the_limits_is_asked_for(flying):
    """The own autopilot, or who speaks in its name, says that it is elsewhere and very fast."""
    limits, autopilot, sent = flying.config.limits, flying.autopilot, []
    autopilot.mute = True
    for _ in range(200):
        there = autopilot.local(flying.now - START)._replace(velocity_ned=(20.0, -15.0, 3.0))
        x, y, z = there.position_ned
        there = there._replace(position_ned=(x + 30.0, y, z))
        sent += only(SetpointLocal, flying.step(flying.datagram("autopilot", there)), "autopilot")
    assert sent
    assert max(math.hypot(*m.velocity) for m in sent) <= math.hypot(*limits.v_max) + 1e-6


def test_after_it_hung_the_plan_starts_anew_where_the_vehicle_is(flying):
    """The autopilot has stopped meanwhile, or drifted: the old plan leads from elsewhere."""
    flying.go_to([6.0, 3.0, 6.0])
    flying.fly(1.0)
    gap = flying.config.guard.hold_us + 100_000
    flying.now += gap + -gap % 20_000
    flying.autopilot.position = flying.autopilot.position - np.array([1.5, 1.5, 0.0])
    flying.autopilot.velocity = np.zeros(3)
    for tick in range(20):
        # What waited for it is old.
        flying.autopilot.mute = tick < 2
        here = flying.autopilot.position.copy()
        for sent in setpoints(flying.step()):
            assert np.linalg.norm(place(sent) - here) < 0.2


def test_taken_over_by_its_mode_switch_it_is_silent_and_then_starts_where_it_is(flying):
    autopilot, profile = flying.autopilot, flying.autopilot.profile
    flying.go_to([4.0, 0.0, 5.0])
    flying.fly(1.0)
    autopilot.mode = 0
    autopilot.velocity = np.zeros(3)
    flying.fly(0.11)
    taken = flying.fly(1.0)
    assert setpoints(taken) == []
    assert commands(taken) == []
    # Nobody is told of a plan that is not flown.
    assert only(Tunnel, taken, "swarm") == []
    autopilot.position, autopilot.yaw = autopilot.position + np.array([0.0, 0.8, 0.3]), 2.5
    flying.fly(1.0)
    here = autopilot.position.copy()
    autopilot.mode = profile.guided_custom_mode
    assert setpoints(flying.fly(1.0)) == []
    flying.order(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 5.0)
    first = setpoints(flying.fly(2.0))[0]
    np.testing.assert_allclose(place(first), here, atol=0.02)
    assert math.remainder(math.pi / 2 - first.yaw - 2.5, math.tau) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("below", [[0.6, 0.0, 0.5], [0.0, 0.0, 2.0], [-0.2, 0.7, 0.3]])
def test_nobody_is_landed_upon(below):
    """Somebody stands below, who will not go away: it moves aside before it orders to land."""
    bench = Bench().take_off(5.0)
    neighbour = bench.datagram("swarm", seen_at(12, below))
    bench.fly(1.0, neighbour)
    bench.order(mavlink.MAV_CMD_NAV_LAND)
    for _ in range(1000):
        before = bench.autopilot.position.copy()
        if commands(bench.step(neighbour)) == [mavlink.MAV_CMD_NAV_LAND]:
            break
    assert bench.phase is Phase.LAND
    assert np.linalg.norm(before[:2] - below[:2]) > bench.config.guard.landing_clearance
    assert np.linalg.norm(bench.autopilot.velocity) < bench.config.guard.landing_speed


def test_a_changed_origin_sends_nothing_far_away(flying):
    """An EKF that moves its origin: set-points wait for a position in the new frame."""
    far = GpsGlobalOrigin(AUTOPILOT, FLEET.latitude + 0.5, FLEET.longitude, FLEET.altitude, 0)
    for message in setpoints(flying.fly(0.5, flying.datagram("autopilot", far))):
        # As the autopilot reads it, in its own frame.
        assert np.linalg.norm(message.position) < 10.0


@pytest.mark.parametrize(("north", "lands"), [(2e-5, False), (1e-3, True)], ids=["2 m", "111 m"])
def test_an_origin_that_takes_the_vehicle_along_is_not_believed(flying, north, lands):
    """The vehicle says the same place in its own frame, whose origin moved: it cannot have."""
    moved = GpsGlobalOrigin(AUTOPILOT, FLEET.latitude + north, FLEET.longitude, FLEET.altitude, 0)
    flying.fly(0.5, flying.datagram("autopilot", moved))
    assert "origin True" in flying.companion.health.concerns or not lands
    assert "origin False" in flying.companion.health.concerns or lands
    assert (flying.phase in (Phase.SETTLE, Phase.LAND, Phase.DONE)) == lands


# What is shared


def test_neighbours_are_told_the_position_always_and_the_plan_in_the_air():
    bench = Bench()
    sent = bench.fly(2.0)
    assert len(only(Heartbeat, sent, "swarm")) == 2
    assert len(only(GlobalPosition, sent, "swarm")) in (19, 20)
    assert only(Tunnel, sent, "swarm") == []
    bench.take_off(5.0)
    bench.go_to([5.0, 5.0, 6.0])
    bench.fly(1.0)
    sent = bench.fly(1.0)
    assert len(only(GlobalPosition, sent, "swarm")) == 10
    plans = only(Tunnel, sent, "swarm")
    assert len(plans) == 10
    last = unpack(plans[-1].payload)
    assert last.origin == FLEET.fingerprint
    assert 0 <= bench.now - last.epoch <= 200_000
    position = only(GlobalPosition, sent, "swarm")[-1]
    shared = FLEET.to_enu(position.latitude, position.longitude, position.altitude)
    assert np.linalg.norm(shared - bench.autopilot.position) < 0.3
    assert {m.source for _, m in sent} == {Source(SYSTEM, 195)}


def test_the_shared_plan_is_the_flown_one():
    bench = Bench().take_off(5.0)
    bench.go_to([5.0, 5.0, 6.0])
    for _ in range(50):
        for tunnel in only(Tunnel, bench.step(), "swarm"):
            flown, told = bench.companion.flown, unpack(tunnel.payload)
            assert (told.epoch, told.dt) == (flown.epoch, flown.dt)
            np.testing.assert_allclose(told.positions_m(), flown.knots[:, 0:3], atol=1e-3)


# What the autopilot says that cannot be


@pytest.mark.parametrize(
    "absurd",
    [
        LocalPosition(AUTOPILOT, 0, (1e30, 0.0, 0.0), (0.0, 0.0, 0.0)),
        LocalPosition(AUTOPILOT, 0, (0.0, 0.0, -5.0), (0.0, 3e38, 0.0)),
        LocalPosition(AUTOPILOT, 0, (2e7, 0.0, 0.0), (0.0, 0.0, 0.0)),
        LocalPosition(AUTOPILOT, 0, (0.0, 0.0, -5.0), (400.0, 0.0, 0.0)),
        Attitude(AUTOPILOT, 0, 1e30, -1e30, 3e38, (0.0, 0.0, 0.0)),
    ],
    ids=["far", "fast", "round the earth", "a bullet", "angles"],
)
def test_absurd_numbers_from_the_own_autopilot_move_nothing(flying, absurd):
    flying.autopilot.mute = True
    found = setpoints(flying.fly(3.0, flying.datagram("autopilot", absurd)))
    assert found
    assert np.isfinite([numbers_of(m) for m in found]).all()
    np.testing.assert_allclose([place(m) for m in found], np.tile(HOLDING, (len(found), 1)), atol=0.1)


# Orders under way


def test_it_holds_where_it_is_told_and_comes_back_to_where_it_started(flying):
    start = flying.autopilot.position.copy()
    flying.go_to([6.0, 3.0, 6.0])
    flying.fly(6.0)
    assert [ack.result for ack in flying.order(mavlink.MAV_CMD_NAV_LOITER_UNLIM)] == [
        mavlink.MAV_RESULT_ACCEPTED
    ]
    flying.fly(3.0)
    held = flying.autopilot.position.copy()
    flying.go_to([-6.0, 0.0, 6.0])
    flying.fly(3.0)
    np.testing.assert_allclose(flying.autopilot.position, held, atol=0.1)
    assert [ack.result for ack in flying.order(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)] == [
        mavlink.MAV_RESULT_ACCEPTED
    ]
    flying.fly(8.0)
    assert flying.phase in (Phase.SETTLE, Phase.LAND, Phase.DONE)
    assert np.linalg.norm(flying.autopilot.position[:2] - start[:2]) < 0.6


@pytest.mark.parametrize("kind", ["spread", "nearest"])
def test_those_that_share_a_surface_tell_their_way_from_the_take_off_on(kind):
    """So that the others' places count with them; the rest tell no way that they do not plan."""
    bench = Bench(task="escort", formation={"kind": kind})
    bench.order(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, 5.0)
    told = []
    for _ in range(2000):
        if bench.phase is Phase.ESCORT:
            break
        told += [m for m in only(Tunnel, bench.step(), "swarm") if m.payload_type == PAYLOAD_TYPE]
    assert bench.phase is Phase.ESCORT
    assert bool(told) is (kind == "spread")
    # The last may be the first plan that it flies.
    for message in told[:-1]:
        assert not np.array(unpack(message.payload).accelerations).any()
