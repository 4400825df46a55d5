"""Ways: free of obstacles, no longer than they must be, as much room as there is, the same every time; and a
point that follows them arrives.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from companion.config.obstacles import Box, Wall
from companion.config.planning import LimitsConfig
from companion.config.way import WayConfig
from companion.obstacles.static import FixedObstacles
from companion.ways.clearance import Clearance, clearance_of
from companion.ways.finding import finding
from companion.ways.grid import grid
from companion.ways.lattice import Lattice
from companion.ways.search import Search
from companion.ways.way import Way
from tests.companion.ways.worlds import (
    BOX,
    LEAST,
    POCKET,
    RING,
    clearances,
    drawn,
    flown,
    free_places,
    least,
    length,
    post,
    result,
    row,
    way,
)

NORTH, UP = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
INSIDE, BEHIND = np.array([0.0, 0.5, 5.0]), np.array([8.0, -0.5, 5.0])
WALL = row((0.0, -9.9), (0.0, 4.0))
"""With a box of 10 m it leaves an opening in the north."""
CORRIDOR = [
    Box(kind="box", at=(0.5 * x, -0.5 * y, 1.25), size=(0.5, 0.5, 2.5))
    for y, cells in enumerate(["#######", "......#", "#####.#", "#.....#", "#.#####", "#......", "#######"])
    for x, cell in enumerate(cells)
    if cell == "#"
]
CORRIDOR_BOX = LimitsConfig(box_min=(-1.0, -3.3, 0.5), box_max=(4.0, 0.3, 2.5))
"""A corridor of half a metre that turns six times within three metres."""


@pytest.mark.parametrize("seed", range(12))
def test_a_way_keeps_its_clearance_and_is_about_as_short_as_the_cells_allow(seed: int) -> None:
    obstacles = drawn(seed)
    ends = free_places(obstacles, 1.0, seed)
    clear = clearances(obstacles)
    found = result(finding(clear, (0.5,), *ends))
    assert found is not None
    assert (found.corners[[0, -1]] == ends).all()
    assert least(obstacles, found.corners) >= 0.5 - 1e-9
    straight = float(np.linalg.norm(ends[1] - ends[0]))
    search = Search(clear, 0.5, *clear.grid.nearest(ends).tolist())
    search.go_on(10**9)
    # The ends are at most half a diagonal away from their cells.
    over_cells = search.length + np.sqrt(3.0) * clear.grid.cell
    assert straight - 1e-9 <= length(found.corners) <= over_cells
    if clear.free(*ends, 0.6):
        assert length(found.corners) == pytest.approx(straight)
    low, high = np.array(BOX.box_min), np.array(BOX.box_max)
    assert ((found.corners >= low) & (found.corners <= high)).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_way_is_about_as_long_back_and_in_a_mirror_and_the_same_again(seed: int) -> None:
    obstacles = [one for one in drawn(seed, 45) if one.kind == "post"]
    image = [one.model_copy(update={"at": (one.at[0], -one.at[1])}) for one in obstacles]
    ends = free_places(obstacles, 1.0, seed)
    there = result(finding(clearances(obstacles), (0.5,), *ends)).corners
    again = result(finding(clearances(obstacles), (0.5,), *ends)).corners
    back = result(finding(clearances(obstacles), (0.5,), *ends[::-1])).corners
    mirror = result(finding(clearances(image), (0.5,), *(ends * [1.0, -1.0, 1.0]))).corners
    assert there.tobytes() == again.tobytes()
    assert length(back) == pytest.approx(length(there), rel=0.05)
    assert length(mirror) == pytest.approx(length(there), rel=0.05)


@pytest.mark.parametrize(("opening", "level"), [(6.0, 0), (2.6, 1), (1.9, 2), (0.8, None)])
def test_a_way_has_as_much_room_as_there_is(opening: float, level: int | None) -> None:
    """Through the opening of a wall, from surface to surface, with a clearance of 1.6, 1.1 or 0.6 m."""
    side = 0.5 * opening + 0.3
    wall = [*row((0.0, -10.5), (0.0, -side)), *row((0.0, side), (0.0, 10.5))]
    tried = [LEAST + share for share in (1.0, 0.5, 0.0)]
    found = result(finding(clearances(wall), tried, np.array([-6.0, 3.0, 5.0]), np.array([6.0, 3.0, 5.0])))
    if level is None:
        assert found is None
        return
    assert found.level == level
    assert least(wall, found.corners) >= tried[level] - 1e-9


def test_a_point_leaves_the_pocket_and_goes_straight_where_it_can() -> None:
    leads = way(POCKET)
    places = flown(leads, INSIDE, BEHIND)
    assert np.abs(places[-1] - BEHIND).max() < 1e-6
    assert leads.begun == 1
    assert least(POCKET, places) > LEAST
    assert places[:, 0].min() < -4.0
    # Through the open end, about half the U, and straight to the goal: 26 m and what the clearance adds.
    assert 26.0 < length(places) < 34.0
    # The other way round there is nothing to leave.
    free = way(POCKET)
    assert free.towards(INSIDE, INSIDE - [8.0, 0.0, 0.0]).beyond == 0.0
    assert free.begun == 0
    assert free.clear


def test_while_it_searches_the_vehicle_aims_at_the_goal_as_without_a_way() -> None:
    leads = way(POCKET, parts=1)
    searching = 0
    while leads.begun == 0:
        subgoal = leads.towards(INSIDE, BEHIND)
        searching += leads.begun == 0
        assert (subgoal.place is BEHIND) == (leads.begun == 0) == (not leads.clear)
    assert searching > 5
    # The number of plans that a search takes is that of its parts.
    faster = way(POCKET, parts=5)
    plans = 0
    while faster.begun == 0:
        faster.towards(INSIDE, BEHIND)
        plans += 1
    assert plans == -(-(searching + 1) // 5)


def test_out_of_a_ring_there_is_no_way_and_the_vehicle_does_as_before() -> None:
    leads = way(RING)
    for _ in range(40):
        subgoal = leads.towards(INSIDE, BEHIND)
        assert subgoal.place is BEHIND
        assert not leads.clear
    assert leads.enclosed
    assert leads.begun == 0
    # It does not search on for ever, but again when the destination has moved.
    assert leads._search is None
    leads.towards(INSIDE, BEHIND + NORTH)
    assert leads._search is not None
    leads.towards(INSIDE, INSIDE - NORTH)
    assert not leads.enclosed


def test_the_box_bounds_the_ways() -> None:
    start, goal = np.array([-6.0, -4.0, 5.0]), np.array([6.0, -4.0, 5.0])
    places = flown(way(WALL), start, goal)
    assert np.abs(places[-1] - goal).max() < 1e-6
    assert places[:, 1].max() < 10.0
    closed = way(WALL, BOX.model_copy(update={"box_max": (10.0, 4.4, 8.0)}))
    assert len(np.unique(flown(closed, start, goal, steps=100), axis=0)) == 1
    assert closed.enclosed


def test_a_low_wall_is_passed_above_except_by_a_vehicle_that_keeps_its_height() -> None:
    low = [one.model_copy(update={"height": 4.5}) for one in row((0.0, -10.5), (0.0, 10.5))]
    start, goal = np.array([-6.0, 0.0, 4.0]), np.array([6.0, 0.0, 4.0])
    places = flown(way(low), start, goal)
    assert np.abs(places[-1] - goal).max() < 1e-6
    assert places[:, 2].max() > 4.5 + LEAST
    planar = way(low, planar=True)
    flown(planar, start, goal, steps=50)
    assert planar.enclosed
    around = way(low[: len(low) // 2], planar=True)
    places = flown(around, start, goal + UP)
    assert np.abs(places[-1] - goal)[:2].max() < 1e-6
    assert around.begun == 1


@pytest.mark.parametrize("prepared", [5.0, 5.25])
def test_the_first_plan_at_the_prepared_height_works_out_no_clearances(
    prepared: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And it is the same plan as without preparation, also at another height."""
    clearance_of.cache_clear()
    place, goal = np.array([-6.0, 0.0, 5.0]), np.array([6.0, 0.5, 5.0])
    plain, ready = (way(POCKET, planar=True, lanes=1.0) for _ in range(2))
    expected = flown(plain, place, goal, steps=30)
    clearance_of.cache_clear()
    ready.prepare(prepared)
    built: list[str] = []
    for of in (Clearance, Lattice):

        def init(self: object, *given: Any, _init: Any = of.__init__, _name: str = of.__name__) -> None:
            built.append(_name)
            _init(self, *given)

        monkeypatch.setattr(of, "__init__", init)
    assert (flown(ready, place, goal, steps=30) == expected).all()
    lanes = ready.lanes()
    assert lanes is not None
    assert lanes is ready.lanes()
    assert built == ([] if prepared == 5.0 else ["Clearance", "Lattice"])
    assert ready.begun == plain.begun > 0


def test_a_destination_that_moves_keeps_its_way_while_a_corner_sees_it() -> None:
    leads = way(WALL)
    place, goal = np.array([-6.0, -4.0, 5.0]), np.array([5.0, -8.0, 5.0])
    ways, gap = set(), np.inf
    for _ in range(400):
        goal = goal + 0.02 * NORTH
        towards = leads.towards(place, goal).place - place
        ways.add(leads.begun)
        if leads.clear:
            place = place + towards * min(1.0, 0.1 / float(np.linalg.norm(towards)))
        gap = float(np.linalg.norm(goal - place))
    assert ways == {0, 1}
    assert gap < 0.1
    # One that goes behind another wall gets another way.
    walls = [*WALL, *row((0.0, 4.0), (9.0, 4.0))]
    other = way(walls)
    start, goal = np.array([6.0, 0.0, 5.0]), np.array([6.0, 2.0, 5.0])
    assert other.towards(start, goal).place is goal
    while other.begun == 0:
        other.towards(start, np.array([5.0, 7.0, 5.0]))
        if other.enclosed:
            break
    assert other.enclosed or other.begun == 1


def test_a_vehicle_pushed_aside_gets_back_to_its_way_or_another() -> None:
    leads = way(POCKET)
    places = flown(leads, INSIDE, BEHIND, steps=40)
    pushed = np.array([-2.0, 3.0, 6.0])
    assert leads.begun == 1
    assert places[-1][0] < INSIDE[0]
    rest = flown(leads, pushed, BEHIND)
    assert np.abs(rest[-1] - BEHIND).max() < 1e-6
    # Pushed over the wall it is where its way does not lead.
    leads = way(POCKET)
    flown(leads, INSIDE, BEHIND, steps=30)
    outside = flown(leads, np.array([0.0, 8.0, 5.0]), BEHIND)
    assert np.abs(outside[-1] - BEHIND).max() < 1e-6
    assert outside[:, 0].min() > -2.0


def test_near_an_obstacle_a_vehicle_still_finds_its_way() -> None:
    """A tenth of a metre from a wall, inside of what a way keeps away from."""
    leads = way(POCKET)
    places = flown(leads, np.array([3.6, 0.0, 5.0]), np.array([4.45, 1.0, 5.0]))
    assert leads.begun == 1
    assert np.abs(places[-1] - [4.45, 1.0, 5.0]).max() < 1e-6


def test_large_boxes_have_larger_cells_and_ways_all_the_same() -> None:
    wide = LimitsConfig(box_min=(-200.0, -200.0, 2.0), box_max=(200.0, 200.0, 40.0))
    wall = [post(0.0, y, 4.0) for y in np.arange(-200.0, 100.0, 7.0).tolist()]
    leads = way(wall, wide, most_cells=20_000)
    start, goal = np.array([-50.0, 0.0, 10.0]), np.array([50.0, 0.0, 10.0])
    places = flown(leads, start, goal, by=1.0)
    assert np.abs(places[-1] - goal).max() < 1e-6
    assert least(wall, places) > LEAST


@pytest.mark.parametrize("thickness", [0.02, 0.5])
def test_a_wall_thinner_than_a_cell_is_a_wall(thickness: float) -> None:
    """Two walls with openings at alternate ends, and one that closes the box."""
    walls = [
        Wall(kind="wall", ends=((-3.0, -10.5), (-3.0, 5.0)), thickness=thickness),
        Wall(kind="wall", ends=((3.1, 10.5), (3.1, -5.0)), thickness=thickness),
    ]
    start, goal = np.array([-3.4, -4.0, 5.0]), np.array([6.0, 4.0, 5.0])
    leads = way(walls)
    places = flown(leads, start, goal)
    assert leads.begun == 1
    assert np.abs(places[-1] - goal).max() < 1e-6
    # It begins nearer to a wall than a way may be, and never gets nearer.
    assert least(walls, places) >= float(FixedObstacles(walls).distance(start).min()) - 1e-9
    assert places[:, 1].max() > 5.0
    closed = way([*walls, Wall(kind="wall", ends=((0.0, -10.5), (0.0, 10.5)), thickness=thickness)])
    flown(closed, start, goal, steps=300)
    assert closed.enclosed


def test_among_thousands_of_boxes_each_cell_is_compared_with_those_near_it() -> None:
    random = np.random.default_rng(5)
    places = random.uniform([-9.5, -9.5, 2.5], [9.5, 9.5, 8.5], (3000, 3)).tolist()
    boxes = [Box(kind="box", at=(x, y, z), size=(0.2, 0.3, 0.1), yaw_deg=25.0) for x, y, z in places]
    clear = clearances(boxes, most=0.8)
    some = clear.grid.places(random.integers(0, len(clear.grid), 60))
    wanted = np.minimum(FixedObstacles(boxes).distance(some).min(axis=1), 0.8)
    assert np.allclose(clear.cells[clear.grid.nearest(some)], wanted, atol=1e-9)
    assert np.allclose(clear.at(some), wanted, atol=1e-9)


def test_a_point_passes_bends_that_are_nearer_to_each_other_than_places_where_it_looks() -> None:
    """A corridor of half a metre that turns six times within three metres."""
    leads = Way(WayConfig(clearance=0.0, cell=0.1), CORRIDOR, CORRIDOR_BOX, 0.2, 10, planar=True)
    start, goal = np.array([-0.6, -0.5, 1.0]), np.array([3.6, -2.5, 1.0])
    places = flown(leads, start, goal, by=0.05)
    assert np.abs(places[-1] - goal).max() < 1e-6
    assert leads.begun == 1
    assert least(CORRIDOR, places) >= 0.15


def test_from_every_place_beside_the_walls_of_a_corridor_a_way_leads() -> None:
    """A corridor of half a metre with a bend; ways keep 0.2 m, a vehicle may be anywhere in it."""
    clear = Clearance(CORRIDOR, grid(CORRIDOR_BOX, 0.1, 150_000, 1.0), 0.5)
    goal = np.array([3.6, -2.5, 1.0])
    middles = np.array([[2.5, -0.5, 1.0], [2.5, -1.0, 1.0], [0.5, -1.5, 1.0], [0.5, -2.5, 1.0]])
    for middle in middles:
        for corner in range(4):
            for off in (0.05, 0.1, 0.15, 0.2):
                place = middle + off * np.array([1 - corner // 2 * 2, 1 - corner % 2 * 2, 0.0])
                found = result(finding(clear, (0.2,), place, goal))
                assert found is not None, place
                assert least(CORRIDOR, found.corners) >= 0.9 * min(0.2, 0.25 - off)


def test_after_the_destination_has_jumped_nothing_leads_to_the_old_one() -> None:
    """Neither a way that is followed, nor a search that was under way."""
    home = np.array([0.0, -9.0, 5.0])
    leads = way(POCKET)
    flown(leads, INSIDE, BEHIND, steps=30)
    assert leads.begun == 1
    assert leads.towards(INSIDE, home).place is home
    searching = way(POCKET, parts=1)
    for _ in range(3):
        searching.towards(INSIDE, BEHIND)
    while searching.begun == 0:
        subgoal = searching.towards(INSIDE, home)
    # The length of a way out of the pocket and back to the south of it, not behind it.
    ahead = float(np.linalg.norm(subgoal.place - INSIDE)) + subgoal.beyond
    assert ahead < 24.0
    assert searching._followed is not None
    assert (searching._followed.corners[-1] == home).all()
    searching.forget()
    assert searching.towards(INSIDE, home).place is home


def test_the_search_of_a_way_to_a_destination_that_moves_fast_comes_to_an_end() -> None:
    """It moves by more in a plan than one that jumps."""
    searching = way(POCKET, parts=1)
    plans = 0
    for plans in range(400):
        angle = plans * 2.2 / 3.5
        searching.towards(INSIDE, np.array([7.0 + 2.5 * np.cos(angle), 3.5 * np.sin(angle), 5.0]))
        if searching.begun:
            break
    assert searching.begun == 1
    assert plans > 1


@pytest.mark.parametrize(("floor", "passes"), [(3.0, True), (3.9, True), (4.1, False), (9.0, False)])
def test_no_way_leads_below_the_floor(floor: float, passes: bool) -> None:
    """A wall from side to side that hangs from the ceiling down to 5 m."""
    hanging = [Box(kind="box", at=(0.0, 0.0, 7.0), size=(1.0, 22.0, 4.0))]
    leads = way(hanging, clearance=0.0)
    leads.keep_above(floor)
    places = flown(leads, np.array([-6.0, 0.0, 7.0]), np.array([6.0, 0.0, 7.0]))
    assert leads.enclosed == (not passes)
    if passes:
        assert np.abs(places[-1] - [6.0, 0.0, 7.0]).max() < 1e-6
        assert places[:, 2].min() >= floor
