"""Clearances, lines and searches on the grid: bounds that hold for all obstacles, and another search."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from companion.config.planning import LimitsConfig
from companion.obstacles.static import FixedObstacles
from companion.values.horizon import Array
from companion.ways.clearance import Clearance, clearance_of
from companion.ways.grid import grid
from companion.ways.search import Search
from tests.companion.ways.worlds import BOX, RING, clearances, drawn, post

SMALL = LimitsConfig(box_min=(-5.0, -5.0, 3.0), box_max=(5.0, 5.0, 6.0))


@pytest.mark.parametrize(("cell", "most"), [(0.5, 150_000), (0.5, 2_000), (0.3, 40_000), (7.0, 1_000)])
def test_a_grid_is_in_the_middle_of_the_box_and_has_no_more_cells_than_allowed(
    cell: float, most: int
) -> None:
    made = grid(BOX, cell, most)
    places = made.places(np.arange(len(made)))
    assert len(made) <= most
    assert made.cell >= cell
    assert (made.nearest(places) == np.arange(len(made))).all()
    low, high = np.array(BOX.box_min), np.array(BOX.box_max)
    assert np.allclose(places.min(axis=0) - low, high - places.max(axis=0))
    assert ((places >= low - 1e-9) & (places <= high + 1e-9)).all()
    # No cell more fits on any axis.
    assert (places.min(axis=0) - low < 0.5 * made.cell + 1e-9).all()


@pytest.mark.parametrize("seed", range(3))
def test_clearances_are_those_of_all_obstacles_at_once(seed: int) -> None:
    obstacles = drawn(seed, 60)
    clear, fixed = clearances(obstacles, most=1.3), FixedObstacles(tuple(obstacles))
    cells = np.arange(0, len(clear.grid), 7)
    wanted = np.minimum(fixed.distance(clear.grid.places(cells)).min(axis=1), 1.3)
    assert np.allclose(clear.cells[cells], wanted, atol=1e-12)
    points = np.random.default_rng(seed).uniform([-12.0, -12.0, 1.0], [12.0, 12.0, 9.0], (500, 3))
    assert np.allclose(clear.at(points), np.minimum(fixed.distance(points).min(axis=1), 1.3), atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_a_free_line_keeps_its_clearance_everywhere_and_a_seen_one_about(seed: int) -> None:
    obstacles = drawn(seed)
    clear, fixed = clearances(obstacles), FixedObstacles(tuple(obstacles))
    random = np.random.default_rng(seed)
    free = seen = 0
    for _ in range(120):
        start, end = random.uniform([-9.5, -9.5, 3.0], [9.5, 9.5, 8.0], (2, 3))
        wanted = random.uniform(0.2, 1.5)
        places = start + np.linspace(0.0, 1.0, 800)[:, None] * (end - start)
        least = float(fixed.distance(places).min())
        if clear.free(start, end, wanted):
            free += 1
            assert least >= wanted - 1e-9
        else:
            # The places between which it looks are 0.2 m apart.
            assert least < np.sqrt(wanted**2 + 0.01) + 1e-9
        ends = 0.9 * min(float(fixed.distance(place).min()) for place in (start, end))
        if clear.sees(start, end, wanted) and ends > wanted:
            seen += 1
            assert least >= wanted - 0.25 * 0.5**2 / wanted
    assert free > 8
    assert seen > 8


def graph(clear: Clearance, clearance: float) -> csr_array:
    """Cells and neighbours of which both have √(r² + L²/4), by arrays alone."""
    made = clear.grid
    index = np.arange(len(made)).reshape(made.shape)
    rows, columns, lengths = [], [], []
    for step in np.ndindex(3, 3, 3):
        by = np.array(step) - 1
        if not by.any():
            continue
        here = tuple(slice(max(0, -b), n - max(0, b)) for b, n in zip(by, made.shape, strict=True))
        there = tuple(slice(max(0, b), n - max(0, -b)) for b, n in zip(by, made.shape, strict=True))
        one, two = index[here].ravel(), index[there].ravel()
        long = made.cell * float(np.linalg.norm(by))
        worse = np.minimum(clear.cells[one], clear.cells[two])
        kept = worse >= np.sqrt(clearance**2 + 0.25 * long**2) - 1e-12
        rows.append(one[kept])
        columns.append(two[kept])
        lengths.append(np.full(int(kept.sum()), long))
    places = np.concatenate(rows), np.concatenate(columns)
    return csr_array((np.concatenate(lengths), places), shape=(len(made), len(made)))


@pytest.mark.parametrize("seed", range(6))
def test_the_search_finds_what_dijkstra_finds(seed: int) -> None:
    clear = clearances(drawn(seed, 25), cell=0.6, limits=SMALL)
    random = np.random.default_rng(seed)
    found = 0
    for clearance in (0.3, 0.8):
        cells = np.flatnonzero(clear.cells > clearance)
        start, *goals = random.choice(cells, 9).tolist()
        shortest = dijkstra(graph(clear, clearance), indices=start)
        for goal in goals:
            search = Search(clear, clearance, start, goal)
            search.go_on(len(clear.grid) + 1)
            assert search.done
            if not np.isfinite(shortest[goal]):
                assert search.cells() is None
                continue
            found += 1
            cells_of = search.cells()
            assert cells_of is not None
            assert (cells_of[0], cells_of[-1]) == (start, goal)
            assert shortest[goal] - 1e-9 <= search.length <= 1.001 * shortest[goal] + 1e-9
            pieces = np.linalg.norm(np.diff(clear.grid.places(cells_of), axis=0), axis=1)
            assert pieces.sum() == pytest.approx(search.length)
            assert (pieces < np.sqrt(3.0) * clear.grid.cell + 1e-9).all()
    assert found >= 4


def test_a_search_in_parts_is_the_same_search() -> None:
    clear = clearances(drawn(3))
    start, goal = clear.grid.nearest(np.array([[-9.0, -9.0, 5.0], [9.0, 9.0, 5.0]])).tolist()
    whole, parts = Search(clear, 0.4, start, goal), Search(clear, 0.4, start, goal)
    whole.go_on(10**9)
    steps = 0
    while not parts.go_on(7):
        steps += 1
        assert parts.cells() is None
        assert parts.expanded == 7 * steps
    assert steps > 10
    assert (whole.cells() == parts.cells()).all()
    assert whole.expanded == parts.expanded


def mirrored(places: Array) -> Array:
    return places * [1.0, -1.0, 1.0]


@pytest.mark.parametrize("seed", range(4))
def test_the_mirrored_world_has_the_mirrored_length(seed: int) -> None:
    world = [one for one in drawn(seed, 45) if one.kind == "post"]
    image = [one.model_copy(update={"at": (one.at[0], -one.at[1])}) for one in world]
    ends = np.array([[-9.0, -6.0, 5.0], [9.0, 7.0, 6.0]])
    lengths = []
    for obstacles, places in ((world, ends), (image, mirrored(ends))):
        clear = clearances(obstacles)
        start, goal = clear.grid.nearest(places).tolist()
        search = Search(clear, 0.4, start, goal)
        search.go_on(10**9)
        lengths.append(search.length)
    assert np.isfinite(lengths[0])
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-3)


def test_out_of_a_ring_nothing_is_found() -> None:
    clear = clearances(RING)
    start, goal = clear.grid.nearest(np.array([[0.0, 0.0, 5.0], [8.0, 0.0, 5.0]])).tolist()
    search = Search(clear, 0.4, start, goal)
    assert search.go_on(10**9)
    assert search.cells() is None
    assert search.length == np.inf
    # It has seen what is inside of the ring, and no more.
    assert search.expanded < len(clear.grid) / 4


def test_a_thousand_obstacles_are_compared_with_the_cells_near_them_only() -> None:
    """Each cell with all of them would be 16 GB and more."""
    random = np.random.default_rng(0)
    wide = LimitsConfig(box_min=(-100.0, -100.0, 0.0), box_max=(100.0, 100.0, 20.0))
    many = [post(*random.uniform(-95.0, 95.0, 2).tolist(), radius=0.2) for _ in range(1000)]
    made = grid(wide, 0.5, 30_000)
    clear = Clearance(many, made, 3.0)
    assert len(made) <= 30_000
    compared = [0 if near is None else len(near) for near in clear._near]
    assert max(compared) < 100
    assert clear.cells.min() < 0.0 < clear.cells.max()


def test_companions_of_one_process_share_the_clearances() -> None:
    obstacles = tuple(drawn(1))
    one = clearance_of(obstacles, BOX, 0.5, 150_000, 1.0)
    assert clearance_of(tuple(drawn(1)), BOX, 0.5, 150_000, 1.0) is one
    assert not one.cells.flags.writeable


def test_without_obstacles_all_places_are_free_also_outside_the_box() -> None:
    clear = clearance_of((), BOX, 0.5, 150_000, 1.0)
    places = np.array([BOX.box_min, BOX.box_max, np.array(BOX.box_max) + 10.0])
    np.testing.assert_array_equal(clear.at(places), clear.most)
