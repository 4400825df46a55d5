"""What a companion does when something is lost, fails, hangs or says nonsense."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.errors import SolverError
from companion.flight.guard import Holding
from companion.values.phase import Phase
from mavlink_bridge.messages import Attitude, GpsGlobalOrigin, LocalPosition, SetpointLocal, Tunnel
from tests.companion.bench import (
    AUTOPILOT,
    FLEET,
    HOLDING,
    START,
    TARGET,
    Bench,
    commands,
    field_of,
    numbers_of,
    only,
    seen_at,
    setpoints,
)


def place(message):
    """ENU position of a set-point; the bench's local frame is the fleet's."""
    north, east, down = message.position
    return np.array([east, north, -down])


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
