"""The backup node flies columns, and holds a first plan that has not begun."""

from __future__ import annotations

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.committed import committed, horizon_of, resting
from companion.avoidance.certified.fingerprint import fingerprint
from mavlink_bridge.messages import CommandLong, Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.agreements import pack as pack_statement
from mavlink_bridge.wire.plan import unpack as unpack_plan
from tests.companion.backup_bench import (
    BEGIN,
    COMPANION,
    CONFIG,
    DT,
    FLEET,
    STEPS,
    SYSTEM,
    Bench,
    accepted,
    plan_from,
    silent,
    told,
)


def hovering(column: bool) -> Bench:
    """The companion hovers over its place, at another height than its plan."""
    bench = Bench()
    plan = resting(BEGIN, DT, STEPS, (1.0, 2.0, 0.1), FLEET.fingerprint, column=column)
    bench.plans = [plan, plan._replace(epoch=BEGIN + 200_000)]
    bench.height = 5.0
    return silent(bench)


def test_a_column_goes_on_at_the_height_of_the_last_set_point() -> None:
    """After a climb the plan is a column of the ground's height, until it becomes a plan in space."""
    bench = hovering(column=True)
    sent = bench.run(2.0)
    assert len(sent) > 80
    for _, message in sent:
        np.testing.assert_allclose(message.position, (2.0, 1.0, -5.0), atol=1e-4)
        np.testing.assert_allclose(message.velocity, 0.0, atol=1e-6)
    assert [unpack_plan(one.payload).column for one in bench.node.farewell(bench.now)[:1]] == [True]


@pytest.mark.parametrize(("column", "height"), [(False, 5.0), (True, float("nan"))])
def test_a_set_point_at_another_height_agrees_with_no_plan_in_space_and_a_nan_with_none(
    column: bool, height: float
) -> None:
    bench = hovering(column)
    bench.speaks, bench.height = True, height
    bench.run(0.1)
    bench.speaks = False
    assert bench.run(2.0) == []
    assert bench.node.farewell(bench.now) == []


@pytest.mark.parametrize(("east", "flies"), [(0.25, True), (0.35, False)])
@pytest.mark.parametrize("height", [0.1, 0.35, 5.0])
def test_only_the_horizontal_distance_of_a_set_point_from_a_column_counts(
    height: float, east: float, flies: bool
) -> None:
    """The plan's height is 0.1 m."""
    bench = hovering(column=True)
    bench.speaks, bench.height, bench.east = True, height, east
    bench.run(0.1)
    bench.speaks = False
    sent = bench.run(1.0)
    assert bool(sent) is flies
    for _, message in sent:
        np.testing.assert_allclose(message.position, (2.0, 1.0, -height), atol=1e-4)


@pytest.mark.parametrize("up", [0.0, 0.35])
def test_a_column_that_still_moves_vertically_is_flown_at_the_heights_of_its_plan(up: float) -> None:
    """It is made of a plan in space."""
    bench = Bench()
    bench.plans = [plan_from(BEGIN)._replace(column=True)]
    assert bench.run(1.0) == []
    place = horizon_of(bench.plans[0]).at(bench.now + CONFIG.setpoint_lead_us).position
    bench.height = float(place[2]) + up
    bench.run(0.02)
    bench.speaks = False
    sent = bench.run(1.0)
    assert bool(sent) is (up == 0.0)
    for time, message in sent:
        planned = horizon_of(bench.plans[0]).at(time + CONFIG.setpoint_lead_us).position
        assert -message.position[2] == pytest.approx(planned[2], abs=2e-3)


def test_a_column_that_becomes_a_plan_in_space_is_flown_at_the_plans_height() -> None:
    bench = hovering(column=True)
    begins = bench.now + 100_000 - bench.now % 200_000 + 200_000
    bench.plans = [resting(begins, DT, STEPS, (1.0, 2.0, 5.2), FLEET.fingerprint)]
    for plan in bench.plans:
        bench.node.step(bench.now, [bench.tell("swarm", told(plan))])
    bench.run(0.6)
    assert -bench.sent[-1][1].position[2] == pytest.approx(5.2, abs=1e-4)


def starting(place: tuple[float, float, float], height: float | None = None) -> Bench:
    """A companion that announced its first plan, held ``place``, and ended before this plan began.

    With a ``height`` (m) it is a column, held at that height.
    """
    bench = Bench()
    begins, bench.height = BEGIN + 800_000, height
    bench.plans = [resting(begins, DT, STEPS, place, FLEET.fingerprint, column=height is not None)]
    assert bench.run(0.3) == []
    said = Statement(
        fingerprint(CONFIG, FLEET), begins, begins, (Entry(12, ((begins, begins),), (begins, begins)),)
    )
    bench.node.step(
        bench.now, [bench.tell("swarm", Tunnel(COMPANION, 0, 0, AGREEMENTS, pack_statement(said)))]
    )
    bench.speaks = False
    return bench


def test_a_first_plan_at_rest_is_held_before_it_begins_and_is_the_last_one() -> None:
    """The others may have agreed on it, and would wait for a farewell for ever."""
    bench = starting((1.0, 2.0, 5.0))
    held = bench.run(0.4)
    assert held
    assert all(np.allclose(sent.position, (2.0, 1.0, -5.0), atol=1e-3) for _, sent in held)
    assert bench.node.farewell(bench.now) == [], "the plan has not begun by the clocks of all"
    bench.run(1.0)
    assert accepted(bench, 12, BEGIN + 800_000)


def test_a_first_column_is_held_at_the_height_of_the_last_set_point_before_it_begins() -> None:
    bench = starting((1.0, 2.0, 5.0), height=3.5)
    held = bench.run(1.4)
    assert held[0][0] < BEGIN + 800_000 < held[-1][0]
    for _, sent in held:
        np.testing.assert_allclose(sent.position, (2.0, 1.0, -3.5), atol=1e-3)
    assert accepted(bench, 12, BEGIN + 800_000)


def test_a_first_plan_at_rest_after_an_order_to_land_is_held_before_it_begins() -> None:
    """The plans of before are discarded, so that it is the earliest one; the vehicle holds its place."""
    bench = Bench()
    bench.run(0.5)
    order = CommandLong(COMPANION, SYSTEM, 1, mavlink.MAV_CMD_NAV_LAND, 0, (0.0,) * 7)
    begins = BEGIN + 1_300_000
    bench.plans = [resting(begins, DT, STEPS, (4.0, 2.0, 5.0), FLEET.fingerprint)]
    bench.node.step(bench.now, [bench.tell("autopilot", order)])
    assert bench.run(0.3) == []
    bench.speaks = False
    held = bench.run(0.4)
    assert held[-1][0] < begins
    for _, sent in held:
        np.testing.assert_allclose(sent.position, (2.0, 4.0, -5.0), atol=1e-3)


@pytest.mark.parametrize(("moves", "east"), [(0.5, 0.0), (0.0, 0.5)])
def test_a_first_plan_that_moves_or_is_elsewhere_is_not_held(moves: float, east: float) -> None:
    bench = Bench()
    bench.east = east
    plan = resting(BEGIN + 800_000, DT, STEPS, (1.0, 2.0, 5.0), FLEET.fingerprint, column=False)
    bench.plans = [committed(plan, np.full((STEPS, 3), moves))]
    bench.run(0.3)
    bench.speaks = False
    assert bench.run(2.0) == []
    assert bench.node.farewell(bench.now) == []
