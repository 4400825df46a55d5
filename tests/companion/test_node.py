"""The companion as a node: a whole flight through bytes, and what others are told."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.values.phase import Phase
from mavlink_bridge.messages import GlobalPosition, Heartbeat, Source, Tunnel
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, unpack
from tests.companion.bench import (
    FLAVOURS,
    FLEET,
    NAN,
    START,
    SYSTEM,
    TARGET,
    Bench,
    commands,
    numbers_of,
    only,
    seen_at,
    setpoints,
)


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
