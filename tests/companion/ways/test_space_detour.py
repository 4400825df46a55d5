"""A vehicle without progress in space goes over or under those that rest: laws of the way, and flights."""

from __future__ import annotations

from itertools import combinations, pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from companion.avoidance.certified.committed import controls
from companion.avoidance.certified.fixed_surfaces import FixedSurfaces
from companion.avoidance.certified.separating_planes import hull_distance
from companion.avoidance.certified.way_obstacles import WayObstacles
from companion.config import CompanionConfig
from companion.config.obstacles import Obstacle, Post
from companion.config.planning import LimitsConfig
from companion.values.horizon import Array
from companion.ways.balls import Balls
from companion.ways.corners import lengths
from companion.ways.space_detour import SpaceDetour
from companion.ways.subgoal import Subgoal
from tests.companion.avoidance.certified.plans import EPOCH, STEPS
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

LIMITS = LimitsConfig(
    u_max=(2.0, 2.0, 1.0), v_max=(1.0, 1.0, 1.0), box_min=(-1.5, -0.5, 0.5), box_max=(1.5, 0.5, 2.5)
)
CUBE = LimitsConfig(box_min=(-1.5, -1.5, 0.5), box_max=(1.5, 1.5, 2.5))
WALL = np.array([[0.0, y, z] for y in (-0.5, 0.0, 0.5) for z in (0.5, 1.2)])
"""Vehicles that rest, from side to side of the box; only above them another one has room."""
START, GOAL = np.array([-0.8, 0.1, 0.8]), np.array([0.8, -0.1, 0.8])
D, ROOM = 0.302, 0.05
NOBODY = Balls(np.empty((0, 3)), np.empty(0), np.empty(0))


def resting(places: Array, flat: float = 0.5) -> Balls:
    return Balls(places, np.zeros(len(places)), np.full(len(places), flat))


def off(points: Array, balls: Balls) -> Array:
    """Distances (k, m) of ``points`` (k, 3) in the measure of the balls."""
    delta = points[:, None] - balls.centres
    delta[..., 2] *= balls.flat
    found: Array = np.linalg.norm(delta, axis=-1)
    return found


def followed(detour: SpaceDetour, start: Array, goal: Array, balls: Balls) -> tuple[Subgoal, Array | None]:
    """The first sub-goal after a whole search, and the way from the start; None without one."""
    for plan in range(500):
        found = detour.towards(200_000 * plan, start, goal, lambda: balls, stands=True, stalled=True)
        if detour.begun:
            assert detour._way is not None
            return found, np.vstack([start, detour._way])
        if detour.enclosed:
            break
    return found, None


def along(way: Array) -> Array:
    return np.concatenate(
        [one + np.linspace(0.0, 1.0, 50)[:, None] * (two - one) for one, two in pairwise(way)]
    )


def crowd(seed: int) -> tuple[Array, Array, Balls]:
    """Start and goal among fifty vehicles at rest, all apart."""
    rng = np.random.default_rng(seed)
    places = np.empty((0, 3))
    while len(places) < 52:
        place = rng.uniform(CUBE.box_min, CUBE.box_max)
        if not len(places) or off(place[None], resting(places)).min() > 0.31:
            places = np.vstack([places, place])
    return places[0], places[1], resting(places[2:])


@pytest.mark.parametrize("seed", range(20))
def test_a_line_is_free_exactly_where_all_of_its_points_are(seed: int) -> None:
    rng = np.random.default_rng(seed)
    balls = Balls(rng.uniform(-2.0, 2.0, (6, 3)), rng.uniform(0.2, 0.8, 6), rng.choice([0.0, 0.3, 1.0], 6))
    start, ends = rng.uniform(-3.0, 3.0, 3), rng.uniform(-3.0, 3.0, (200, 3))
    shares = np.linspace(0.0, 1.0, 800)[:, None]
    least = np.array([(off(start + shares * (end - start), balls) - balls.radii).min() for end in ends])
    found = balls.passed(start, ends)
    assert found[least > 0.01].all()
    assert not found[least < -1e-6].any()
    assert found.any()
    assert not found.all()
    assert (found == balls.passed(ends, np.broadcast_to(start, ends.shape))).all()


@pytest.mark.parametrize("seed", range(8))
def test_a_way_keeps_the_distance_except_where_its_ends_are_nearer(seed: int) -> None:
    """From one place to another among fifty that rest; it is in the box, and the same each time."""
    start, goal, balls = crowd(seed)
    found, way = followed(SpaceDetour((), CUBE, D, D, ROOM), start, goal, balls)
    if way is None:
        assert found == Subgoal(goal, 0.0)
        return
    assert (way[-1] == goal).all()
    least = np.minimum(D, 0.9 * np.minimum(off(start[None], balls)[0], off(goal[None], balls)[0]))
    assert (off(along(way), balls) >= least - 1e-9).all()
    assert (way >= np.array(CUBE.box_min) - 1e-9).all()
    assert (way <= np.array(CUBE.box_max) + 1e-9).all()
    assert lengths(way)[-1] >= np.linalg.norm(goal - start) - 1e-9
    again = followed(SpaceDetour((), CUBE, D, D, ROOM), start, goal, balls)[1]
    assert again is not None
    assert (again == way).all()


def test_most_of_the_crowds_leave_a_way() -> None:
    ways = [followed(SpaceDetour((), CUBE, D, D, ROOM), *crowd(seed))[1] for seed in range(8)]
    assert sum(way is not None for way in ways) >= 6


def test_over_a_landed_vehicle_or_a_post_there_is_no_way() -> None:
    """Heights do not count there: those of the wall in the middle leave no way, as vehicles in the air do."""
    high = WALL[WALL[:, 2] > 1.0]
    assert followed(SpaceDetour((), LIMITS, D, D, ROOM), START, GOAL, resting(high))[1] is not None
    closed, way = followed(SpaceDetour((), LIMITS, D, D, ROOM), START, GOAL, resting(high, 0.0))
    assert way is None
    assert closed == Subgoal(GOAL, 0.0)
    posts: list[Obstacle] = [Post(kind="post", at=(x, y), radius=0.01) for x, y in high[:, :2].tolist()]
    detour = SpaceDetour(posts, LIMITS, D, D, ROOM)
    blocked = resting(np.array([[0.0, 0.2, 0.8]]))
    assert followed(detour, START, GOAL, blocked)[1] is None
    assert detour.enclosed


def test_without_a_stall_the_goal_is_the_goal_and_a_free_line_ends_a_way() -> None:
    detour, wall = SpaceDetour((), LIMITS, D, D, ROOM), resting(WALL)
    assert detour.towards(0, START, GOAL, lambda: wall, stands=False, stalled=False) == Subgoal(GOAL, 0.0)
    aside, way = followed(detour, START, GOAL, wall)
    assert way is not None
    # Between two of the upper row.
    assert way[:, 2].max() > 1.2 + 2.0 * np.sqrt(D**2 - 0.25**2)
    assert detour.led
    # It keeps to the way while this is free, also when there is progress again.
    place = aside.place
    after = detour.towards(1, place, GOAL, lambda: wall, stands=False, stalled=False)
    assert np.linalg.norm(after.place - place) + after.beyond <= aside.beyond + 1e-9
    assert after.beyond < aside.beyond
    assert detour.towards(2, place, GOAL, lambda: NOBODY, stands=False, stalled=False) == Subgoal(GOAL, 0.0)
    # That it was led there counts on the rest of its way, and not on the way to another goal.
    assert detour.led
    assert detour.towards(3, START, GOAL, lambda: wall, stands=False, stalled=False) == Subgoal(GOAL, 0.0)
    assert detour.led
    # Nor on the way to one that it has become in small steps.
    for step in range(1, 7):
        other = GOAL + np.array([0.1 * step, 0.0, 0.0])
        detour.towards(3 + step, START, other, lambda: NOBODY, stands=False, stalled=False)
    assert not detour.led
    detour.towards(10, START, GOAL, lambda: wall, stands=False, stalled=False)
    assert detour.led
    other = GOAL + np.array([0.6, 0.0, 0.0])
    assert detour.towards(11, START, other, lambda: wall, stands=False, stalled=False) == Subgoal(other, 0.0)
    assert not detour.led


def test_a_plan_that_stands_searches_a_way_before_there_is_no_progress_for_long() -> None:
    detour = SpaceDetour((), LIMITS, D, D, ROOM)
    for plan in range(20):
        detour.towards(200_000 * plan, START, GOAL, lambda: resting(WALL), stands=True, stalled=False)
    assert detour.begun == 1
    # Where nobody rests on the line there is nothing to search, and the turn is not given up.
    detour = SpaceDetour((), LIMITS, D, D, ROOM)
    assert detour.towards(0, START, GOAL, lambda: NOBODY, stands=True, stalled=False) == Subgoal(GOAL, 0.0)
    assert not detour.straight


def test_a_way_that_is_closed_is_searched_anew_without_a_stall() -> None:
    """Beside the wall's top row, which leaves a gap at each side; one of the gaps is closed then."""
    wide = LimitsConfig(box_min=(-1.5, -1.2, 0.5), box_max=(1.5, 1.2, 2.5))
    wall = np.vstack([WALL, *(WALL[1::2] + np.array([0.0, 0.0, more]) for more in (0.7, 1.3))])
    detour = SpaceDetour((), wide, D, D, ROOM)
    _, way = followed(detour, START, GOAL, resting(wall))
    assert way is not None
    side = np.sign(way[np.abs(way[:, 0]).argmin(), 1])
    gap = np.array([[0.0, side * 1.0, z] for z in (0.5, 1.2, 1.9, 2.5)])
    closed = resting(np.vstack([wall, gap]))
    for plan in range(20, 60):
        detour.towards(200_000 * plan, START, GOAL, lambda: closed, stands=False, stalled=False)
        if detour.begun == 2:
            break
    assert detour.begun == 2
    assert detour._way is not None
    assert np.sign(detour._way[np.abs(detour._way[:, 0]).argmin(), 1]) == -side


def test_a_way_on_which_a_vehicle_does_not_get_on_counts_as_narrow() -> None:
    """After five seconds at one place; not while it flies along the way, and not towards another goal."""
    detour, wall = SpaceDetour((), LIMITS, D, D, ROOM), resting(WALL)
    _, way = followed(detour, START, GOAL, wall)
    assert way is not None

    def step(tenths: int, rest: Array, goal: Array = GOAL) -> None:
        detour.towards(100_000_000 + 100_000 * tenths, rest, goal, lambda: wall, stands=False, stalled=False)

    places = along(way)[: len(along(way)) // 4]
    for tenths in range(80):
        step(tenths, places[tenths * len(places) // 80])
        assert not detour.narrow
    here = places[-1]
    for tenths in range(80, 140):
        step(tenths, here)
    assert detour.narrow
    # Ways that are begun where the last one was lost count as one with it.
    step(139, here + np.array([0.0, 0.1, 0.0]))
    assert detour.narrow
    step(140, here, GOAL - np.array([0.6, 0.0, 0.0]))
    assert not detour.narrow


def flown(starts: Array, goals: Array, limits: LimitsConfig, seconds: int) -> float:
    """Return how far from its goal a vehicle is at the end, at most, m; all keep their distances."""
    swarm = Swarm(
        starts,
        Rough(delay=1_000),
        [Habits()] * len(starts),
        1,
        settings={"tube": 0.001, "drift": 0.001, "clock_us": 0},
        more={"limits": limits, "field": {"d_min": 0.3, "d_safe": 1.5, "downwash": 2.0}},
    )
    until = 1_000_000 * seconds
    swarm.run(until, lambda _since, system: goals[system - 1])
    ends = np.array([one.plan(EPOCH + until).positions_m()[0] for one in swarm.vehicles])
    least = np.inf
    for epoch in swarm.epochs():
        now = [controls(one.plan(epoch))[:1] / (1.0, 1.0, 2.0) for one in swarm.vehicles]
        least = min(
            least, float(hull_distance(np.concatenate([a - b for a, b in combinations(now, 2)])).min())
        )
    assert least > D - 1e-9
    return float(np.abs(ends - goals).max())


def test_a_vehicle_arrives_behind_a_wall_of_vehicles_that_rest() -> None:
    assert flown(np.vstack([START, WALL]), np.vstack([GOAL, WALL]), LIMITS, 9) < 0.05


def test_two_that_meet_head_on_in_a_tube_pass_each_other() -> None:
    """Neither has room beside the other one; both search the same way at about the same time."""
    tube = LimitsConfig(
        u_max=(2.0, 2.0, 1.0), v_max=(1.0, 1.0, 1.0), box_min=(-1.5, -0.05, 0.5), box_max=(1.5, 0.05, 2.5)
    )
    starts = np.array([[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0]])
    assert flown(starts, starts[::-1], tube, 9) < 0.05


def test_heights_of_landed_vehicles_and_columns_do_not_count_as_those_of_others_do() -> None:
    ends = {2: np.array([1.0, 0.0, 2.0]), 3: np.array([0.0, 1.0, 2.0])}
    landed = SimpleNamespace(controls=np.full((STEPS, 3, 3), 0.5), plan=SimpleNamespace(column=True))
    peers: Any = SimpleNamespace(left={4: landed}, columns=(3,), resting=lambda *_: ends)
    for planar, flat in ((False, [0.0, 0.5, 0.0]), (True, [0.0, 0.0, 0.0])):
        config = CompanionConfig.model_validate(
            {"avoidance": "certified", "planar": planar, "field": {"downwash": 2.0}}
        )
        obstacles = WayObstacles(config, FixedSurfaces(config))
        found = obstacles.at_rest(0, peers)
        assert (found.centres == [[0.5, 0.5, 0.5], ends[2], ends[3]]).all()
        assert found.flat.tolist() == flat
