"""The way out from above a box is the nearest one that has room."""

from __future__ import annotations

from math import hypot

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.config import CompanionConfig
from companion.config.obstacles import Box, Obstacle, Post
from companion.goals.roofs import Roofs
from companion.goals.settling import Settling
from companion.obstacles.static import FixedObstacles
from companion.values.horizon import Array, Motion
from companion.world import World
from mavlink_bridge.frames import FleetFrame

WIDE = np.full(2, 1e4)
DISTANCE, CLEAR = 2.0, 1.75
FIELD = CompanionConfig()
_share = st.floats(-0.99, 0.99)
_size = st.floats(0.5, 60.0)
roofs = st.builds(
    Box,
    kind=st.just("box"),
    at=st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.just(3.0)),
    size=st.tuples(_size, _size, st.just(6.0)),
    yaw_deg=st.floats(-360.0, 360.0),
)


def above(box: Box, shares: tuple[float, float]) -> Array:
    """The place (2,), m, above a box at these shares of its half sizes."""
    yaw = np.radians(box.yaw_deg)
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    return np.array(box.at[:2]) + (0.5 * np.array(shares) * np.array(box.size[:2])) @ axes


def beside(places: Array, known: list[Obstacle]) -> Array:
    """Least distances of ``places`` (n, 2) from obstacles, in the height of their middles."""
    points = np.column_stack([places, np.full(len(places), 3.0)])
    return np.asarray(FixedObstacles(known).distance(points).min(axis=1))


@given(roofs, st.tuples(_share, _share))
def test_no_place_beside_the_box_is_nearer(box: Box, shares: tuple[float, float]) -> None:
    here = above(box, shares)
    place = Roofs([box]).way_out(0, here, DISTANCE, CLEAR, -WIDE, WIDE)
    assert place is not None
    way = float(np.linalg.norm(place - here))
    assert abs(beside(place[None], [box])[0] - DISTANCE) < 1e-9
    angles = np.linspace(0.0, 2.0 * np.pi, 721)
    ring = here + (way - 1e-3) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    assert (beside(ring, [box]) < DISTANCE).all()


@given(roofs, st.tuples(_share, _share), st.lists(roofs, min_size=1, max_size=3), st.floats(10.0, 80.0))
def test_the_place_has_room_and_is_within_limits(
    box: Box, shares: tuple[float, float], others: list[Box], most: float
) -> None:
    here, limits = above(box, shares), np.full(2, most)
    known: list[Obstacle] = [Post(kind="post", at=(1.0, -30.0), radius=1.0), *others, box]
    number = len(known) - 1
    place = Roofs(known).way_out(number, here, DISTANCE, CLEAR, -limits, limits)
    alone = Roofs([box]).way_out(0, here, DISTANCE, CLEAR, -limits, limits)
    if place is not None:
        assert (np.abs(place) <= most).all()
        assert beside(place[None], known[:-1])[0] >= CLEAR - 1e-9
        assert beside(place[None], [box])[0] >= DISTANCE - 1e-9
    if alone is not None and beside(alone[None], known[:-1])[0] >= CLEAR + 1e-9:
        assert place is not None
        assert np.array_equal(place, alone)


@given(roofs, st.tuples(st.floats(1.01, 3.0), _share))
def test_beside_a_box_and_for_a_post_there_is_none(box: Box, shares: tuple[float, float]) -> None:
    known: list[Obstacle] = [Post(kind="post", at=(0.0, 0.0), radius=1.0), box]
    assert Roofs(known).way_out(1, above(box, shares), DISTANCE, CLEAR, -WIDE, WIDE) is None
    assert Roofs(known).way_out(0, np.zeros(2), DISTANCE, CLEAR, -WIDE, WIDE) is None


def settled(known: tuple[Obstacle, ...], here: Array) -> tuple[Array, float]:
    """Where a vehicle is clear that flies where settling sends it, and how far it has flown."""
    config = FIELD.model_copy(update={"obstacles": known})
    picture = World(config, 11, 1, FleetFrame(47.4, 8.5, 488.0))
    settling, flown = Settling(config), 0.0
    for _ in range(60):
        prediction = np.broadcast_to(here, (config.horizon.steps + 1, 3))
        near_by = picture.obstacles(1, picture.at(1), prediction)
        there = settling.rest(1, Motion(here, np.zeros(3), np.zeros(3)), near_by)
        if settling.clear:
            return here, flown
        flown += hypot(*(there - here)[:2])
        here = there
    raise AssertionError("it does not settle")


def test_above_a_long_box_it_leaves_over_the_nearest_side() -> None:
    """Its east end is 30 m away, its north side 2 m."""
    roof = Box(kind="box", at=(0.0, -1.0, 3.0), size=(60.0, 6.0, 6.0))
    place, flown = settled((roof,), np.array([0.0, 0.0, 20.0]))
    assert place[0] == 0.0
    assert 2.0 + FIELD.guard.landing_clearance < place[1] == flown
    assert flown < 2.0 + FIELD.guard.landing_clearance + 2.0


@given(st.lists(st.tuples(st.integers(-2, 2), st.integers(-2, 2)), max_size=12, unique=True), _share, _share)
def test_among_adjoining_roofs_it_settles(tiles: list[tuple[int, int]], x: float, y: float) -> None:
    """It does not go back and forth between two."""
    known = tuple(
        Box(kind="box", at=(6.0 * east, 6.0 * north, 3.0), size=(6.0, 6.0, 6.0)) for east, north in tiles
    )
    assume(known)
    place, _ = settled(known, np.array([3.0 * x, 3.0 * y, 20.0]))
    assert beside(place[None, :2], list(known))[0] >= FIELD.guard.landing_clearance
