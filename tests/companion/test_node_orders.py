"""Who may command a companion, and what it answers."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.flight.orders import Orders
from companion.values.phase import Phase
from mavlink_bridge.messages import CommandAck, CommandInt, CommandLong, Heartbeat, LocalPosition, Source
from tests.companion.bench import (
    FLEET,
    GROUND,
    HOLDING,
    LINKS,
    NAN,
    SYSTEM,
    Bench,
    commands,
    numbers_of,
    only,
    setpoints,
)


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


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(("off", "taken"), [(-0.5, True), (0.0, True), (0.09, True), (0.11, False)])
def test_a_goal_about_on_the_edge_of_the_box_is_taken_within_it(axis, side, off, taken):
    """Positions are rounded to 1.1 cm, so a goal on the edge may arrive outside."""
    config = CompanionConfig(task="goto")
    low, high = np.array(config.limits.box_min), np.array(config.limits.box_max)
    goal = 0.5 * (low + high)
    goal[axis] = (low, goal, high)[1 + side][axis] + side * off
    goals = SimpleNamespace(goal=None)
    orders = Orders(config, Source(SYSTEM, 195), FLEET, None, goals)
    latitude, longitude, altitude = FLEET.to_geodetic(goal)
    place = round(latitude * 1e7), round(longitude * 1e7), altitude
    (ack,) = orders.obey(
        CommandInt(GROUND, SYSTEM, 195, 0, mavlink.MAV_CMD_DO_REPOSITION, (-1.0, 0.0, 0.0, NAN), *place)
    )
    assert (ack.result == mavlink.MAV_RESULT_ACCEPTED) == taken
    assert (goals.goal is not None) == taken
    if taken:
        np.testing.assert_allclose(goals.goal, np.clip(goal, low, high), atol=0.01)
        assert (goals.goal >= low).all()
        assert (goals.goal <= high).all()


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
