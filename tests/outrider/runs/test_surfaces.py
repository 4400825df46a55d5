"""Distances from fixed obstacles: those of sampled solids, whatever the yaw, and of no more than is near."""

from __future__ import annotations

from math import hypot, radians

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from companion.config.obstacles import Box, Obstacle, Post, Sphere, Wall
from companion.obstacles.static import FixedObstacles
from outrider.runs.ground_truth import GroundTruth, Limits
from outrider.runs.surfaces import Nearby, Surfaces
from outrider.scenarios.footprints import circles, rectangles

LAWS = settings(deadline=None, max_examples=50)
LIMIT = 0.5
NUMBER = st.floats(-8.0, 8.0)
POINTS = st.tuples(NUMBER, NUMBER, NUMBER)
SIZES = st.floats(0.2, 4.0)
YAWS = st.floats(-360.0, 360.0)
BOXES = st.builds(
    lambda at, size, yaw: Box(kind="box", at=at, size=size, yaw_deg=yaw),
    POINTS,
    st.tuples(SIZES, SIZES, SIZES),
    YAWS,
)
ENDS = st.tuples(st.tuples(NUMBER, NUMBER), st.tuples(NUMBER, NUMBER)).filter(
    lambda ends: hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]) > 0.1
)
WALLS = st.builds(
    lambda ends, thickness, height: Wall(kind="wall", ends=ends, thickness=thickness, height=height),
    ENDS,
    SIZES,
    SIZES,
)
ROUND = st.one_of(
    st.builds(lambda at, radius: Sphere(kind="sphere", at=at, radius=radius), POINTS, SIZES),
    st.builds(
        lambda at, radius, height: Post(kind="post", at=at[:2], radius=radius, height=height),
        POINTS,
        SIZES,
        SIZES,
    ),
)
ANY = st.one_of(BOXES, WALLS, ROUND)


def distance(obstacle: Obstacle, point: object) -> float:
    return float(Surfaces((obstacle,)).distance(np.array([point]), np.array([0]))[0])


def surface_points(box: Box) -> np.ndarray:
    """Points (n, 3) on all six sides, at most ``STEP`` of a side apart."""
    share = np.linspace(-0.5, 0.5, 41)
    u, v = (part.ravel() for part in np.meshgrid(share, share))
    sides = []
    for axis in range(3):
        for end in (-0.5, 0.5):
            side = np.empty((len(u), 3))
            side[:, axis], side[:, (axis + 1) % 3], side[:, (axis + 2) % 3] = end, u, v
            sides.append(side * box.size)
    x, y, z = np.vstack(sides).T
    yaw = radians(box.yaw_deg)
    turned = np.stack([np.cos(yaw) * x - np.sin(yaw) * y, np.sin(yaw) * x + np.cos(yaw) * y, z], axis=1)
    return turned + box.at


@LAWS
@given(BOXES, POINTS)
def test_a_box_is_as_far_as_the_nearest_of_its_surface(box: Box, point: tuple[float, float, float]) -> None:
    sampled = float(np.linalg.norm(surface_points(box) - point, axis=1).min())
    found = abs(distance(box, point))
    assert found <= sampled + 1e-9
    assert sampled <= hypot(found, *(side / 40.0 for side in box.size)) + 1e-9


@LAWS
@given(BOXES, st.tuples(*[st.floats(-0.75, 0.75)] * 3))
def test_distances_are_negative_inside_and_only_there(box: Box, share: tuple[float, float, float]) -> None:
    assume(all(abs(abs(part) - 0.5) > 1e-6 for part in share))
    x, y, z = np.multiply(share, box.size)
    yaw = radians(box.yaw_deg)
    point = np.array([np.cos(yaw) * x - np.sin(yaw) * y, np.sin(yaw) * x + np.cos(yaw) * y, z]) + box.at
    assert (distance(box, point) < 0.0) == all(abs(part) < 0.5 for part in share)


@LAWS
@given(BOXES, POINTS, YAWS)
def test_the_scene_may_be_turned(box: Box, point: tuple[float, float, float], turn_deg: float) -> None:
    cos, sin = np.cos(radians(turn_deg)), np.sin(radians(turn_deg))

    def turned(place: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = place
        return cos * x - sin * y, sin * x + cos * y, z

    yaw = (box.yaw_deg + turn_deg) % 360.0
    same = Box(kind="box", at=turned(box.at), size=box.size, yaw_deg=yaw)
    assert distance(same, turned(point)) == pytest.approx(distance(box, point), abs=1e-9)


@LAWS
@given(BOXES, POINTS)
def test_a_quarter_turn_swaps_the_sides(box: Box, point: tuple[float, float, float]) -> None:
    x, y, z = box.size
    yaw = (box.yaw_deg + 90.0) % 360.0
    swapped = Box(kind="box", at=box.at, size=(y, x, z), yaw_deg=yaw)
    assert distance(swapped, point) == pytest.approx(distance(box, point), abs=1e-9)


@LAWS
@given(WALLS, POINTS)
def test_a_wall_stands_between_its_ends(wall: Wall, point: tuple[float, float, float]) -> None:
    begin, end = np.array(wall.ends)
    share = np.linspace(0.0, 1.0, 7)[:, None]
    for east, north in begin + share * (end - begin):
        # In its middle plane: half a thickness, half a height or the way to an end away from the surface.
        assert distance(wall, (east, north, 0.5 * wall.height)) <= 1e-9
        assert distance(wall, (east, north, wall.height + 1.0)) == pytest.approx(1.0)
        assert distance(wall, (east, north, -1.0)) == pytest.approx(1.0)
    assert distance(wall, point) == pytest.approx(distance(wall.box, point), abs=1e-9)


@LAWS
@given(st.lists(ANY, min_size=1, max_size=6), st.lists(POINTS, min_size=1, max_size=5))
def test_the_companion_knows_the_same_distances(
    obstacles: list[Obstacle], points: list[tuple[float, float, float]]
) -> None:
    every = np.arange(len(obstacles))
    mine = Surfaces(obstacles).distance(np.array(points)[:, None], every)
    theirs = FixedObstacles(tuple(obstacles)).distance(np.array(points))
    np.testing.assert_allclose(mine, theirs, atol=1e-9)


# Paths among many obstacles


def forest(random: np.random.Generator, count: int, half: float) -> list[Obstacle]:
    """Boxes, walls, spheres and posts within ``half`` m."""
    found: list[Obstacle] = []
    for k in range(count):
        east, north, up = random.uniform((-half, -half, 0.0), (half, half, 6.0)).tolist()
        size = tuple(random.uniform(0.2, 2.0, 3).tolist())
        yaw = float(random.uniform(0.0, 180.0))
        end = (east + 2.0 * np.cos(yaw), north + 2.0 * np.sin(yaw))
        kinds: tuple[Obstacle, ...] = (
            Box(kind="box", at=(east, north, up), size=size, yaw_deg=yaw),
            Wall(kind="wall", ends=((east, north), end), thickness=0.2, height=size[0] + 2.0),
            Sphere(kind="sphere", at=(east, north, up), radius=0.5 * size[0]),
            Post(kind="post", at=(east, north), radius=0.5 * size[0], height=size[1] + 2.0),
        )
        found.append(kinds[k % 4])
    return found


def paths(random: np.random.Generator, steps: int, vehicles: int, length: float) -> np.ndarray:
    """Smooth paths (T, K, 3), parts of which are missing: not in the air."""
    begin = random.uniform((-9.0, -9.0, 0.5), (9.0, 9.0, 6.0), (vehicles, 3))
    heading = random.uniform(0.0, 2.0 * np.pi, vehicles)
    along = np.stack([np.cos(heading), np.sin(heading), 0.1 * np.sin(heading)], axis=1)
    track = begin + np.linspace(0.0, length, steps)[:, None, None] * along
    for k in range(vehicles):
        first = int(random.integers(0, steps))
        track[first : first + int(random.integers(0, steps // 3 + 1)), k] = np.nan
    return track


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.integers(1, 150), st.floats(0.0, 20.0))
def test_the_nearest_of_all_is_found(seed: int, count: int, steps: int, length: float) -> None:
    random = np.random.default_rng(seed)
    surfaces = Surfaces(forest(random, count, 10.0))
    track = paths(random, steps, 2, length)
    every = surfaces.distance(track[:, :, None], np.arange(count)).min(axis=2)
    np.testing.assert_array_equal(surfaces.nearest(track), every)


def test_the_nearest_of_an_end_may_be_far_from_the_middle() -> None:
    """One is near the middle of a straight path, the other beyond its end, and there a bit nearer."""
    beside = Sphere(kind="sphere", at=(5.0, 3.0, 1.0), radius=0.1)
    beyond = Sphere(kind="sphere", at=(15.7, 0.0, 1.0), radius=0.1)
    path = np.array([[[float(k), 0.0, 1.0]] for k in range(11)])
    found = Surfaces((beside, beyond)).nearest(path)
    assert found[5, 0] == pytest.approx(2.9)
    assert found[10, 0] == pytest.approx(5.6)


def test_without_obstacles_the_nearest_is_infinitely_far() -> None:
    found = Surfaces(()).nearest(np.array([[[0.0, 0.0, 1.0]], [[np.nan] * 3]]))
    assert np.isinf(found[0, 0])
    assert np.isnan(found[1, 0])


@settings(deadline=None, max_examples=20)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 60),
    st.integers(2, 500),
    st.floats(0.0, 20.0),
    st.lists(st.integers(1, 499), max_size=5),
)
def test_encounters_are_those_of_all_pairs(
    seed: int, count: int, steps: int, length: float, cuts: list[int]
) -> None:
    """However the flight is cut into samples, and although most pairs are never computed."""
    random = np.random.default_rng(seed)
    surfaces = Surfaces(forest(random, count, 10.0))
    track = paths(random, steps, 3, length)
    truth = GroundTruth(3, Limits(0.1, obstacles=LIMIT), surfaces)
    nothing = np.full((1, 3), np.nan)
    for part in np.split(track, sorted({min(cut, steps) for cut in cuts})):
        if len(part):
            moving = np.empty((len(part), 0, 3))
            truth.take(0, part, np.zeros((3, 17)), np.tile(nothing, (len(part), 1)), moving)
    every = surfaces.distance(track[:, :, None], np.arange(count)).reshape(steps, -1)
    known = every[np.isfinite(every)]
    assert truth.obstacles.minimum == (known.min() if len(known) else np.inf)
    assert truth.obstacles.count == sum(map(stays, every.T))


def stays(distances: np.ndarray) -> int:
    """How often a pair comes below the limit; it keeps its state while its distance is unknown."""
    total, inside = 0, False
    for one in distances[~np.isnan(distances)]:
        total += bool(one < LIMIT) and not inside
        inside = bool(one < LIMIT)
    return total


def test_far_obstacles_cost_nothing() -> None:
    random = np.random.default_rng(3)
    near = forest(random, 40, 6.0)
    far = [
        Box(kind="box", at=(100.0 + 3.0 * (k % 60), 3.0 * (k // 60), 2.0), size=(1.0, 1.0, 4.0))
        for k in range(3000)
    ]
    track = paths(random, 200, 4, 3.0)
    few = Nearby(Surfaces(near), 4).pairs(track, LIMIT)
    many = Nearby(Surfaces([*near, *far]), 4).pairs(track, LIMIT)
    assert len(few.vehicle) > 0
    for one, other in zip(few, many, strict=True):
        np.testing.assert_array_equal(one, other)


# Seen from above


@LAWS
@given(st.lists(ANY, max_size=6))
def test_footprints_are_the_edges_of_the_solids(obstacles: list[Obstacle]) -> None:
    flat = [one.box if isinstance(one, Wall) else one for one in obstacles]
    boxes = [one for one in flat if isinstance(one, Box)]
    found = rectangles(obstacles)
    assert found.shape == (len(boxes), 4, 2)
    for box, corners in zip(boxes, found, strict=True):
        for corner in corners:
            assert distance(box, (*corner, box.at[2])) == pytest.approx(0.0, abs=1e-9)
        following = np.roll(corners, -1, axis=0)
        area = 0.5 * float(np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]))
        assert area == pytest.approx(box.size[0] * box.size[1])
    assert len(circles(obstacles)) == len(flat) - len(boxes)
