"""A vehicle without progress goes round what rests: laws of the shortest way, and a pocket that it leaves."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from companion.avoidance.certified import detour as module
from companion.avoidance.certified.detour import Detour, Subgoal
from companion.avoidance.certified.fixed_surfaces import FixedSurfaces
from companion.avoidance.certified.room import Room
from companion.avoidance.certified.visibility_graph import Discs, Rectangles, finding, free
from companion.avoidance.certified.way_obstacles import WayObstacles
from companion.config import CompanionConfig
from companion.config.planning import LimitsConfig
from companion.values.horizon import Array
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm
from tests.companion.ways.worlds import result

LOW, HIGH = np.full(2, -30.0), np.full(2, 30.0)
NOTHING = Discs(np.empty((0, 2)), np.empty(0))


def way(*scene: Any) -> Array | None:
    """The way that a whole search finds."""
    found: Array | None = result(finding(*scene))
    return found


def drawn(seed: int) -> tuple[Array, Array, Discs]:
    """Start and goal outside of twelve discs, of which several overlap."""
    random = np.random.default_rng(seed)
    discs = Discs(random.uniform(-10.0, 10.0, (12, 2)), random.uniform(0.5, 3.5, 12))
    while True:
        ends = random.uniform(-12.0, 12.0, (2, 2))
        if (np.linalg.norm(ends[:, None] - discs.centres, axis=-1) > discs.radii / 0.98).all():
            return ends[0], ends[1], discs


def length(start: Array, corners: Array) -> float:
    return float(np.linalg.norm(np.diff(np.vstack([start, corners]), axis=0), axis=1).sum())


def along(start: Array, corners: Array) -> Array:
    """Places on the way, a hundred on each piece."""
    pieces = list(pairwise(np.vstack([start, corners])))
    return np.concatenate([one + np.linspace(0.0, 1.0, 100)[:, None] * (two - one) for one, two in pieces])


@pytest.mark.parametrize("seed", range(40))
def test_a_way_ends_at_the_goal_and_enters_no_disc(seed: int) -> None:
    start, goal, discs = drawn(seed)
    found = way(start, goal, discs, LOW, HIGH)
    assert found is not None
    assert (found[-1] == goal).all()
    off = np.linalg.norm(along(start, found)[:, None] - discs.centres, axis=-1) - discs.radii
    assert off.min() >= -1e-6


@pytest.mark.parametrize("seed", range(40))
def test_a_way_is_as_long_in_both_directions_and_straight_where_that_is_free(seed: int) -> None:
    start, goal, discs = drawn(seed)
    there, back = way(start, goal, discs, LOW, HIGH), way(goal, start, discs, LOW, HIGH)
    assert there is not None
    assert back is not None
    straight = float(np.linalg.norm(goal - start))
    assert length(start, there) == pytest.approx(length(goal, back))
    assert (len(there) == 1) == bool(free(start, goal[None], discs)[0])
    assert length(start, there) >= straight - 1e-9
    # Fewer discs never make the way longer.
    fewer = way(start, goal, Discs(discs.centres[:6], discs.radii[:6]), LOW, HIGH)
    assert fewer is not None
    assert length(start, fewer) <= length(start, there) * 1.04


def test_round_one_disc_the_way_is_near_the_arc_and_its_tangents() -> None:
    found = way(
        np.array([-5.0, 0.0]), np.array([5.0, 0.0]), Discs(np.zeros((1, 2)), np.array([3.0])), LOW, HIGH
    )
    assert found is not None
    shortest = 2.0 * (4.0 + 3.0 * (np.pi / 2.0 - np.arccos(0.6)))
    assert shortest <= length(np.array([-5.0, 0.0]), found) <= 1.04 * shortest


def test_out_of_a_closed_ring_there_is_no_way() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 9)[:-1]
    ring = Discs(5.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1), np.full(8, 2.0))
    assert way(np.zeros(2), np.array([12.0, 0.0]), ring, LOW, HIGH) is None
    opened = Discs(ring.centres[1:], ring.radii[1:])
    assert way(np.zeros(2), np.array([12.0, 0.0]), opened, LOW, HIGH) is not None
    # The box closes the gap of the ring.
    assert way(np.zeros(2), np.array([-4.0, 9.0]), opened, LOW, np.array([3.0, 30.0])) is None


def halls(seed: int) -> tuple[Array, Array, Discs]:
    """Start and goal outside of six discs and eight rectangles, of which several overlap."""
    random = np.random.default_rng(seed)
    angles = random.uniform(-np.pi, np.pi, 8)
    discs = Discs(
        random.uniform(-10.0, 10.0, (6, 2)),
        random.uniform(0.5, 2.0, 6),
        Rectangles(
            random.uniform(-10.0, 10.0, (8, 2)),
            10.0 ** random.uniform(-1.0, 0.5, (8, 2)),
            np.stack([np.cos(angles), np.sin(angles)], axis=1),
            random.uniform(0.3, 1.0, 8),
        ),
    )
    while True:
        ends = random.uniform(-12.0, 12.0, (2, 2))
        if (room(ends, discs) > 0.5).all():
            return ends[0], ends[1], discs


def room(places: Array, discs: Discs) -> Array:
    """Distances (k,) of places (k, 2) from the nearest disc or rectangle, by clipping; negative within."""
    round_ = np.linalg.norm(places[:, None] - discs.centres, axis=-1) - discs.radii
    found = [round_]
    for centre, half, (cos, sin), radius in zip(*discs.rectangles, strict=True):
        own = (places - centre) @ np.array([[cos, -sin], [sin, cos]])
        found.append((np.linalg.norm(own - np.clip(own, -half, half), axis=1) - radius)[:, None])
    return np.concatenate(found, axis=1).min(axis=1)


@pytest.mark.parametrize("seed", range(20))
def test_a_line_is_free_exactly_where_all_of_its_points_are(seed: int) -> None:
    start, _, discs = halls(seed)
    ends = np.random.default_rng(seed).uniform(-12.0, 12.0, (200, 2))
    shares = np.linspace(0.0, 1.0, 800)[:, None]
    least = np.array([room(start + shares * (end - start), discs).min() for end in ends])
    found = free(start, ends, discs)
    assert found[least > 0.02].all()
    assert not found[least < -1e-6].any()
    assert found.any()


@pytest.mark.parametrize("seed", range(12))
def test_a_way_among_rectangles_enters_none_and_is_as_long_in_both_directions(seed: int) -> None:
    start, goal, discs = halls(seed)
    there, back = way(start, goal, discs, LOW, HIGH), way(goal, start, discs, LOW, HIGH)
    assert (there is None) == (back is None)
    if there is None or back is None:
        return
    assert room(along(start, there), discs).min() >= -1e-6
    assert length(start, there) == pytest.approx(length(goal, back))
    assert (len(there) == 1) == bool(free(start, goal[None], discs)[0])


def test_round_a_wall_the_way_is_near_its_end() -> None:
    wall = Rectangles(*np.array([[[1.0, 2.0]], [[0.1, 4.0]], [[1.0, 0.0]]]), np.array([1.0]))
    found = way(np.array([-4.0, 0.0]), np.array([6.0, 0.0]), NOTHING._replace(rectangles=wall), LOW, HIGH)
    assert found is not None
    # Tangents to the two corners at the near end, of the circles of 1 m about them.
    shortest = 2.0 * np.hypot(4.9, 3.0)
    assert shortest <= length(np.array([-4.0, 0.0]), found) <= 1.04 * shortest
    assert found[:, 1].min() == pytest.approx(-3.0, abs=0.1)


def test_a_rectangle_that_holds_an_end_is_reduced() -> None:
    wall = Rectangles(*np.array([[[0.0, 0.0]], [[0.1, 4.0]], [[1.0, 0.0]]]), np.array([1.0]))
    found = way(np.array([-0.5, 0.0]), np.array([5.0, 0.0]), NOTHING._replace(rectangles=wall), LOW, HIGH)
    assert found is not None
    assert room(along(np.array([-0.5, 0.0]), found), NOTHING._replace(rectangles=wall)).min() > -1.0


def test_without_a_stall_the_goal_is_the_goal_and_a_free_line_ends_a_way() -> None:
    limits = LimitsConfig()
    detour, goal = Detour(limits, 3.0), np.array([8.0, 0.0, 5.0])
    wall = [Discs(np.array([[4.0, 0.0]]), np.array([2.0]))]
    rest = np.array([0.0, 0.0, 5.0])
    assert detour.towards(0, rest, goal, lambda: wall, stalled=False).place is goal
    aside = detour.towards(0, rest, goal, lambda: wall, stalled=True)
    assert aside.place[1] != 0.0
    straight = float(np.linalg.norm(goal - rest))
    assert float(np.linalg.norm(aside.place - rest)) + aside.beyond > straight
    # It keeps to the way, also when there is progress again.
    assert detour.towards(200_000, rest, goal, lambda: wall, stalled=False).place[1] == aside.place[1]
    assert detour.towards(400_000, rest, goal, lambda: [NOTHING], stalled=False) == Subgoal(goal, 0.0)
    assert detour.towards(600_000, rest, goal, lambda: wall, stalled=False).place is goal


def boxes(seed: int) -> tuple[Array, Array, Discs]:
    """Eight boxes, and a ring of discs around the goal that leaves no way."""
    random = np.random.default_rng(seed)
    turns = random.uniform(0.0, np.pi, 8)
    ring = 2.0 * np.pi * np.arange(12) / 12
    return (
        np.array([-14.0, 0.0]),
        np.array([14.0, 0.0]),
        Discs(
            np.array([14.0, 0.0]) + 4.0 * np.stack([np.cos(ring), np.sin(ring)], axis=1),
            np.full(12, 1.2),
            Rectangles(
                random.uniform([-10.0, -10.0], [7.0, 10.0], (8, 2)),
                random.uniform(0.5, 1.5, (8, 2)),
                np.stack([np.cos(turns), np.sin(turns)], axis=1),
                np.full(8, 0.6),
            ),
        ),
    )


@pytest.mark.parametrize("closed", [True, False])
def test_no_plan_does_more_than_a_part_of_a_search(closed: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    here, there, discs = boxes(1)
    if not closed:
        discs = discs._replace(centres=np.delete(discs.centres, [5, 6, 7], axis=0), radii=discs.radii[3:])
    parts = 0

    def counted(*scene: Any) -> Any:
        nonlocal parts
        work = finding(*scene)
        while True:
            try:
                next(work)
            except StopIteration as end:
                return end.value
            parts += 1
            yield

    whole = way(here, there, discs, LOW, HIGH)
    assert (whole is None) == closed
    monkeypatch.setattr(module, "finding", counted)
    limits = LimitsConfig(box_min=(-30.0, -30.0, 3.0), box_max=(30.0, 30.0, 10.0))
    detour = Detour(limits, 3.0)
    rest, goal = np.array([*here, 5.0]), np.array([*there, 5.0])
    plans, most = 0, 0
    for plan in range(24):
        before = parts
        subgoal = detour.towards(200_000 * plan, rest, goal, lambda: [discs], stalled=True)
        most, plans = max(most, parts - before), plans + (parts > before)
        if detour.begun:
            break
    assert 0 < most <= 30
    assert plans > 1
    if whole is not None:
        assert float(np.linalg.norm(subgoal.place - rest)) + subgoal.beyond == pytest.approx(
            length(here, whole)
        )


def test_a_blocked_way_is_searched_anew_without_a_stall() -> None:
    """The search takes several plans; there is progress in them, because the deadlock's turn began anew.

    Until it ends the vehicle follows the old way: straight to the goal it would fly back into the pocket.
    """
    here, there, discs = boxes(1)
    open_ = discs._replace(centres=np.delete(discs.centres, [5, 6, 7], axis=0), radii=discs.radii[3:])
    limits = LimitsConfig(box_min=(-30.0, -30.0, 3.0), box_max=(30.0, 30.0, 10.0))
    detour, plan = Detour(limits, 3.0), 0
    rest, goal = np.array([*here, 5.0]), np.array([*there, 5.0])
    while not detour.begun:
        detour.towards(200_000 * plan, rest, goal, lambda: [open_], stalled=True)
        plan += 1
    aside = detour.towards(200_000 * plan, rest, goal, lambda: [open_], stalled=False).place
    off = aside - rest
    blocking = open_._replace(
        centres=np.vstack([open_.centres, (rest + 0.7 * off)[:2]]), radii=np.append(open_.radii, 0.5)
    )
    for later in range(plan + 1, plan + 40):
        found = detour.towards(200_000 * later, rest, goal, lambda: [blocking], stalled=False).place
        if detour.begun == 2:
            break
        np.testing.assert_allclose(found, aside)
    assert later > plan + 1
    assert detour.begun == 2
    assert np.abs(found - aside).max() > 0.1


def test_a_way_through_what_rests_is_kept_and_searched_anew_where_there_is_no_progress() -> None:
    """Those that rest close all ways; the way among what stays for ever leads through them."""
    here, there, ring = boxes(1)
    fixed = ring._replace(centres=NOTHING.centres, radii=NOTHING.radii)
    shortest = way(here, there, fixed, LOW, HIGH)
    assert shortest is not None
    limits = LimitsConfig(box_min=(-30.0, -30.0, 3.0), box_max=(30.0, 30.0, 10.0))
    detour, now = Detour(limits, 3.0), 0
    rest, goal = np.array([*here, 5.0]), np.array([*there, 5.0])

    def subgoal(resting: Discs, *, stalled: bool) -> Subgoal:
        nonlocal now
        now += 200_000
        return detour.towards(now, rest, goal, lambda: [resting, fixed], stalled=stalled)

    while not detour.begun and now < 20_000_000:
        subgoal(ring, stalled=True)
    for _ in range(30):
        found = subgoal(ring, stalled=False)
        assert detour.begun == 1
        assert float(np.linalg.norm(found.place - rest)) + found.beyond == pytest.approx(
            length(here, shortest)
        )
    opened = ring._replace(centres=np.delete(ring.centres, [5, 6, 7], axis=0), radii=ring.radii[3:])
    until = now + 6_000_000
    while detour.begun == 1 and now < until:
        subgoal(opened, stalled=True)
    assert detour.begun == 2


POCKET = np.array(
    [[-3.0, 2.0], [-3.0, 0.0], [-2.6, -2.0], [-1.0, -3.2], [1.0, -3.2], [2.6, -2.0], [3.0, 0.0], [3.0, 2.0]]
)
"""Vehicles that rest, m: the gaps are less than twice the least distance of plans.

The pocket is open to the left of one that flies east; the deadlock turn is to the right, by π at most.
"""


def flown() -> tuple[Swarm, float]:
    """A vehicle in a pocket of others that rest, whose goal is behind them; its distance at the end, m."""
    starts = np.array([[0.0, 0.0, 5.0], *([*place, 5.0] for place in POCKET)])
    goals = starts.copy()
    goals[0] = 9.0, 0.0, 5.0
    swarm = Swarm(starts, Rough(delay=20_000), [Habits()] * len(starts), 1, planar=True)
    gaps = np.linalg.norm(np.diff(POCKET, axis=0), axis=1)
    assert swarm.d < gaps.min()
    assert gaps.max() < 2.0 * swarm.d
    swarm.run(25_000_000, lambda since, system: goals[system - 1])
    end = swarm.vehicles[0].plan(EPOCH + 25_000_000).positions_m()[0]
    return swarm, float(np.linalg.norm(end - goals[0]))


def test_a_vehicle_leaves_a_pocket_of_vehicles_that_rest() -> None:
    swarm, off = flown()
    assert swarm.faults() == []
    assert off < 0.3


def test_without_a_detour_and_without_room_it_stays_in_the_pocket(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        Detour, "towards", lambda _self, _now, _rest, goal, _discs, *, stalled: Subgoal(goal, 0.0)
    )
    monkeypatch.setattr(Room, "asked", lambda _self, _rest, _subgoal, *, closed, occupied: None)
    assert flown()[1] > 3.0


@pytest.mark.parametrize("turned", [False, True])
def test_a_box_below_an_end_leaves_the_ways_around_the_rest(turned: bool) -> None:
    """No way leads out of a rectangle: with that of the box there would be none around the post either."""
    box = {"kind": "box", "at": (0.0, 0.0, 1.5), "size": (4.0, 4.0, 3.0)}
    post = {"kind": "post", "at": (8.0, 0.0), "radius": 1.0}
    ends = np.array([[0.0, 0.0, 6.0], [16.0, 0.0, 2.0]])
    here, there = ends[::-1] if turned else ends
    config = CompanionConfig.model_validate({"avoidance": "certified", "obstacles": [box, post]})
    none: Any = SimpleNamespace(left={}, columns=(), resting=lambda *_: {})
    (discs, _) = WayObstacles(config, FixedSurfaces(config)).resting(0, here, there, none)
    found = way(here[:2], there[:2], discs, *np.array([[-50.0, -50.0], [50.0, 50.0]]))
    assert found is not None
    assert np.abs(found[:, 1]).max() > 1.0
