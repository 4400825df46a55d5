"""Where it stays, comes back to and settles: each order counts from where it finds the vehicle."""

from __future__ import annotations

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.errors import SolverError
from companion.values.phase import Phase
from mavlink_bridge.messages import CommandLong
from outrider.resources import find
from outrider.scenarios.fly_config import FlyConfig
from outrider.yaml_files.yaml_file import load
from tests.companion.bench import NAN, SYSTEM, TARGET, Bench, field_of, only, seen_at

GO = (mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, 5)
BESIDE = 12
"""A neighbour's system id."""


def off(bench: Bench, place) -> float:
    """How far (m, seen from above) it is from there."""
    return float(np.linalg.norm(bench.autopilot.position[:2] - np.asarray(place)[:2]))


def carried_away(bench: Bench, place) -> Bench:
    """A pilot takes it over, flies it there, and the operator gives a new go."""
    bench.autopilot.mode, bench.autopilot.landing = mavlink.COPTER_MODE_LOITER, False
    bench.fly(0.5)
    assert bench.phase is Phase.YIELDED
    bench.autopilot.position, bench.autopilot.velocity = np.array(place, dtype=float), np.zeros(3)
    bench.fly(3.0)
    bench.order(*GO)
    return bench.until(Phase.ESCORT)


def beside(bench: Bench, seconds: float, place) -> Bench:
    """Let time pass with a neighbour that hovers there, at most until it lands."""
    for _ in range(round(100 * seconds)):
        received = bench.datagram("swarm", seen_at(BESIDE, place))
        bench.step(*([received] if bench.now % 100_000 == 0 else []))
        if bench.phase in (Phase.LAND, Phase.DONE):
            break
    return bench


@pytest.mark.parametrize("task", ["goto", "escort"])
def test_told_to_stay_on_the_way_back_it_stays_there(task: str) -> None:
    bench = Bench(task=task)
    if task == "escort":
        bench.target = seen_at(TARGET, (20.0, 0.0, 0.0))
    bench.take_off()
    bench.go_to((15, 0, 5))
    bench.fly(10.0)
    bench.order(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    bench.fly(2.5)
    half_way = bench.autopilot.position
    bench.order(mavlink.MAV_CMD_NAV_LOITER_UNLIM)
    bench.fly(8.0)
    assert off(bench, half_way) < 3.0


def test_told_to_stay_again_it_stays_where_it_is_then() -> None:
    bench = Bench().take_off()
    bench.go_to((8, 0, 5))
    bench.fly(1.5)
    bench.order(mavlink.MAV_CMD_NAV_LOITER_UNLIM)
    bench.fly(4.0)
    bench.order(*GO)
    bench.go_to((15, 10, 5))
    bench.fly(8.0)
    there = bench.autopilot.position
    bench.order(mavlink.MAV_CMD_NAV_LOITER_UNLIM)
    bench.fly(8.0)
    assert off(bench, there) < 0.5


@pytest.mark.parametrize("task", ["goto", "escort"])
def test_carried_somewhere_else_it_stays_there(task: str) -> None:
    """The target is lost, or no goal was ever ordered: then it is to stay where it is."""
    bench = Bench(task=task)
    if task == "escort":
        bench.target = seen_at(TARGET, (15.0, 0.0, 0.0))
    bench.take_off()
    bench.fly(8.0)
    bench.target = None
    bench.fly(6.0)
    carried_away(bench, (-10.0, -10.0, 6.0)).fly(10.0)
    assert off(bench, (-10.0, -10.0)) < 0.5


def test_an_ordered_goal_outlasts_a_takeover() -> None:
    bench = Bench().take_off()
    bench.go_to((8, 0, 5))
    bench.fly(5.0)
    carried_away(bench, (-10.0, -10.0, 6.0)).fly(10.0)
    assert off(bench, (8.0, 0.0)) < 0.5


def test_it_settles_anew_each_time_it_is_to_land() -> None:
    bench = Bench().take_off()
    bench.order(mavlink.MAV_CMD_NAV_LAND)
    bench.until(Phase.LAND).fly(0.3)
    carried_away(bench, (0.0, 0.0, 6.0))
    bench.go_to((15, 0, 6))
    bench.fly(2.0)
    assert np.linalg.norm(bench.autopilot.velocity) > 2.0
    began = bench.autopilot.position
    bench.order(mavlink.MAV_CMD_NAV_LAND)
    assert bench.phase is Phase.SETTLE
    bench.until(Phase.LAND)
    assert np.linalg.norm(bench.autopilot.velocity) < 0.5
    assert 0.5 < off(bench, began) < 5.0


@pytest.mark.parametrize("offset", range(10))
def test_who_is_to_land_as_it_begins_to_steer_looks_who_is_near(offset: int) -> None:
    """Whichever look finds the battery empty on the way up, with somebody 0.6 m beside the way down."""
    bench = Bench()
    # It is up a tick later each time, and looks ten times a second.
    bench.order(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, 5.0 + 0.02 * offset)
    place = (0.6, 0.0, 3.5)
    while bench.autopilot.position[2] < 1.0:
        beside(bench, 0.01, place)
    bench.autopilot.battery = 0.05
    beside(bench, 40.0, place)
    assert bench.phase is Phase.LAND
    assert off(bench, place) > bench.config.guard.landing_clearance


@pytest.mark.parametrize("start", [-19.9, -21.0, -30.0])
def test_who_started_beside_its_box_comes_back_to_the_edge_and_lands(start: float) -> None:
    bench = Bench(start=(start, 0.0, 0.0), field={"position_sigma": 0.3}).take_off()
    assert bench.config.limits.box_min[0] == -20.0
    bench.go_to((0, 0, 5))
    bench.fly(12.0)
    bench.order(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    bench.until(Phase.LAND, 40.0)
    assert off(bench, (-20.0, 0.0)) < 1.0


@pytest.mark.parametrize("distance", [1.0, 1.75, 2.25])
def test_who_finds_its_start_taken_lands_beside_it(distance: float) -> None:
    field = {"d_min": 0.95, "d_safe": 3.0, "gain": 20.0, "position_sigma": 0.3}
    bench = Bench(field=field, tangential={"force_max": 5.0}).take_off()
    bench.go_to((10, 0, 5))
    bench.fly(8.0)
    place = (0.0, -distance, 5.0)
    beside(bench, 1.0, place)
    bench.order(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    beside(bench, 60.0, place)
    assert bench.phase is Phase.LAND
    assert off(bench, (0.0, 0.0)) < 6.0
    assert off(bench, place) > bench.config.guard.landing_clearance


def test_what_failed_is_over_when_somebody_takes_the_vehicle_over() -> None:
    bench = Bench().take_off()
    planner = field_of(bench.companion).planner
    plan = planner.plan

    def fails(*_args, **_kwargs):
        raise SolverError("none", 1)

    planner.plan = fails
    bench.fly(0.2)
    assert bench.companion.avoidance.failing is not None
    bench.autopilot.mode, bench.autopilot.velocity = mavlink.COPTER_MODE_LOITER, np.zeros(3)
    bench.fly(0.5)
    planner.plan = plan
    sent = bench.fly(10.0)
    assert bench.companion.avoidance.failing is None
    assert not only(CommandLong, sent)
    assert not any("solver" in name for name in bench.companion.health.concerns)


def test_a_vehicle_with_a_lane_climbs_to_it_before_it_sets_off() -> None:
    """Lanes keep vehicles apart that are in them; while all climb, they are side by side."""
    bench = Bench(guard={"return_step": 3.0})
    received = bench.datagram("swarm", seen_at(SYSTEM - 1, (-15.0, 15.0, 5.0)))
    bench.fly(0.5, received)
    bench.take_off()
    bench.go_to((15, 0, 5))
    bench.fly(12.0)
    assert off(bench, (15.0, 0.0)) < 0.5
    bench.order(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    while off(bench, (15.0, 0.0)) < 1.0:
        bench.step(*([received] if bench.now % 100_000 == 0 else []))
        assert bench.phase is Phase.RETURN
    assert bench.autopilot.position[2] > 5.0 + 3.0 - 1.1
    bench.until(Phase.DONE, 60.0)
    assert off(bench, (0.0, 0.0)) < 1.0


@pytest.mark.parametrize("planar", [True, False])
def test_committed_plans_return_at_their_height_if_planar_and_in_a_lane_otherwise(planar: bool) -> None:
    """A vehicle whose plans keep their height would never reach a lane, and so never set off."""
    bench = Bench(avoidance="certified", planar=planar, guard={"return_step": 3.0}).take_off()
    height = float(bench.autopilot.position[2])
    bench.go_to((15, 0, height))
    received = bench.datagram("swarm", seen_at(SYSTEM - 1, (-30.0, 30.0, 5.0)))
    bench.fly(12.0, received)
    assert off(bench, (15.0, 0.0)) < 0.5
    bench.order(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    highest = height
    for _ in range(2_000):
        bench.step(*([received] if bench.now % 100_000 == 0 else []))
        if bench.phase is not Phase.RETURN:
            break
        highest = max(highest, float(bench.autopilot.position[2]))
    assert bench.phase is Phase.SETTLE
    assert off(bench, (0.0, 0.0)) < 0.6
    assert highest < height + 0.1 if planar else highest > height + 3.0 - 1.1


@pytest.mark.parametrize("east", [8.0, 10.0, 12.0])
def test_the_target_pushes_no_vehicle_into_the_lane_above(east: float) -> None:
    """The way back of the lowest vehicle leads over the target, with the shipped settings."""
    shipped = load(find("companions", "ardupilot"), FlyConfig).companion.model_dump()
    bench = Bench(**shipped)
    bench.target = seen_at(TARGET, (20.0, 0.0, 1.5))
    bench.take_off().fly(15.0)
    assert off(bench, (15.0, 0.0)) < 0.5
    bench.target = seen_at(TARGET, (east, 0.5, 1.5))
    bench.fly(0.8)
    bench.order(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    above = 0.0
    while bench.phase is Phase.RETURN:
        bench.step()
        plan = field_of(bench.companion).plan
        assert plan is not None
        above = max(above, float(bench.autopilot.position[2] - plan.aim.destination[2]))
    assert above < 0.5
    bench.until(Phase.DONE, 60.0)
    assert off(bench, (0.0, 0.0)) < 1.0
