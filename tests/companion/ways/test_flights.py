"""A companion among posts that it knows: it flies around them to goals, back to its start and to a target."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.config.obstacles import Box, Obstacle, Post
from companion.obstacles.static import FixedObstacles
from companion.values.horizon import Array
from companion.values.phase import Phase
from mavlink_bridge.messages import StatusText
from tests.companion.bench import TARGET, Bench, only, seen_at
from tests.companion.ways.worlds import POCKET, RING

BEHIND = (10.0, 0.5, 5.0)
LIMITS = {"box_min": [-14.0, -12.0, 3.0], "box_max": [14.0, 12.0, 8.0]}
NO_WAY = "No way to the destination past obstacles"


def bench(obstacles: Any = POCKET, **settings: Any) -> Bench:
    return Bench(
        start=(-1.0, 0.0, 0.0),
        obstacles=[one.model_dump() for one in obstacles],
        limits=LIMITS,
        **{"way": {}, **settings},
    )


def flown(of: Bench, seconds: float, place: Any) -> Array:
    """Fly until it is there, or for so long; the places, at each step."""
    places = []
    for _ in range(round(100 * seconds)):
        of.step()
        places.append(of.autopilot.position.copy())
        if np.linalg.norm(places[-1] - place) < 0.3:
            break
    return np.array(places)


def off(of: Bench, place: Any) -> float:
    return float(np.linalg.norm(of.autopilot.position - np.asarray(place)))


def test_it_flies_out_of_a_pocket_to_its_goal_and_back_to_its_start() -> None:
    of = bench().take_off()
    of.go_to(BEHIND)
    places = flown(of, 30.0, BEHIND)
    assert off(of, BEHIND) < 0.3
    assert FixedObstacles(tuple(POCKET)).distance(places).min() > of.config.field.d_min
    assert ((places > np.array(LIMITS["box_min"]) - 1e-3) & (places < LIMITS["box_max"])).all()
    of.order(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    of.until(Phase.SETTLE, 40.0)
    assert np.linalg.norm(of.autopilot.position[:2] - [-1.0, 0.0]) < 1.0


def test_without_ways_it_stays_in_the_pocket() -> None:
    of = bench(way=None).take_off()
    of.go_to(BEHIND)
    flown(of, 15.0, BEHIND)
    assert off(of, BEHIND) > 4.0


def test_it_stays_where_it_is_told_to_although_it_is_under_way() -> None:
    of = bench().take_off()
    of.go_to(BEHIND)
    of.fly(4.0)
    of.order(mavlink.MAV_CMD_NAV_LOITER_UNLIM)
    of.fly(4.0)
    place = of.autopilot.position.copy()
    of.fly(2.0)
    assert off(of, place) < 0.1
    assert off(of, BEHIND) > 5.0


@pytest.mark.parametrize("ways", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_it_gets_to_a_target_that_flies_behind_the_wall(ways: bool) -> None:
    """The target appears behind the U, and flies on along it at 1 m/s."""
    of = bench(
        task="escort", surface={"kind": "circle", "radius": 2.0, "height": 5.0}, way={} if ways else None
    )
    of.target = seen_at(TARGET, (-3.0, 0.0, 0.0))
    of.take_off()
    place = np.array([10.0, 4.0, 0.0])
    for _ in range(1000):
        place[1] -= 0.01
        of.target = seen_at(TARGET, place, (-1.0, 0.0, 0.0))
        of.step()
    of.target = seen_at(TARGET, place)
    of.fly(5.0)
    standoff = float(np.linalg.norm(of.autopilot.position[:2] - place[:2]))
    assert abs(standoff - 2.0) < 0.3 if ways else standoff > 4.0


def test_where_there_is_no_way_the_ground_is_told_until_there_is_one() -> None:
    of = bench(RING, ground_messages={"texts": True}).take_off()

    def told(seconds: float) -> list[str]:
        return [
            text.text for _ in range(round(100 * seconds)) for text in only(StatusText, of.step(), "ground")
        ]

    of.go_to(BEHIND)
    texts = told(4.0)
    assert [text for text in texts if NO_WAY in text] == [NO_WAY]
    assert NO_WAY in {one.text for one in of.companion.health.concerns.values()}
    of.go_to((0.5, 1.0, 5.0))
    told(2.0)
    assert not of.companion.health.concerns
    assert off(of, (0.5, 1.0, 5.0)) < 1.0


@pytest.mark.parametrize("least", [None, 0.3])
@pytest.mark.parametrize("kind", ["box", "post"])
def test_committed_plans_pass_a_gap_as_wide_as_the_least_distance_of_obstacles(
    kind: str, least: float | None
) -> None:
    """1.6 m wide: too narrow for 0.5 m and a tube of 0.35 m at both sides, wide enough for 0.3 m."""
    gap: list[Obstacle] = []
    for side in (-1.0, 1.0):
        if kind == "box":
            gap.append(Box(kind="box", at=(4.0, side * 6.8, 5.0), size=(1.0, 12.0, 12.0)))
        else:
            gap += [Post(kind="post", at=(4.0, side * (1.3 + 0.9 * k)), radius=0.5) for k in range(13)]
    of = bench(
        gap,
        avoidance="certified",
        planar=True,
        field={"d_min": 0.5},
        certified={"tube": 0.35, "d_min_obstacle": least},
        way={"clearance": 0.0, "cell": 0.1},
    ).take_off()
    of.go_to(BEHIND)
    places = flown(of, 25.0, BEHIND)
    assert (off(of, BEHIND) < 0.3) == (least is not None)
    assert FixedObstacles(tuple(gap)).distance(places).min() > (0.5 if least is None else least)


def test_an_order_to_return_among_walls_is_not_flown_along_the_old_way() -> None:
    """It leaves the pocket towards a goal behind it. The way back is searched for some plans."""
    of = bench(way={"parts": 1}).take_off()
    of.go_to(BEHIND)
    of.fly(4.0)
    goals = of.companion._goals
    assert goals._way is not None
    assert goals._way.begun == 1
    of.order(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    of.fly(0.1)
    assert of.phase is Phase.RETURN
    followed = goals._way._followed
    assert followed is None or np.linalg.norm(followed.corners[-1][:2] - [-1.0, 0.0]) < 0.5


@pytest.mark.parametrize("least", [None, 6.75])
def test_an_ordered_goal_and_the_way_to_it_keep_the_least_height(least: float | None) -> None:
    """A wall from side to side that hangs down to 7 m, and a goal behind it at 4 m."""
    hanging = [Box(kind="box", at=(4.0, 0.0, 8.0), size=(1.0, 24.0, 2.0))]
    of = bench(hanging, guard={"least_height": least}, way={"clearance": 0.0}).take_off()
    of.go_to((10.0, 0.0, 4.0))
    places = flown(of, 12.0, (10.0, 0.0, 4.0))
    assert (off(of, (10.0, 0.0, 4.0)) < 0.3) == (least is None)
    if least is not None:
        assert places[:, 0].max() < 4.0
        assert of.companion._goals.enclosed
        assert places[-1, 2] > 6.5
