"""Nearest points of boxes and signed distances: laws of a distance, and what a path is pushed away from."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from companion.values.boxes import Boxes, BoxIndex, beside, distances
from companion.values.horizon import Array


def drawn(rng: np.random.Generator, count: int, room: float = 8.0) -> Boxes:
    """Boxes of all proportions, thin walls and flat plates among them."""
    angles = rng.uniform(-np.pi, np.pi, count)
    angles[rng.uniform(size=count) < 0.3] = 0.0
    return Boxes(
        rng.uniform(-room, room, (count, 3)),
        10.0 ** rng.uniform(-1.5, 0.6, (count, 3)),
        np.stack([np.cos(angles), np.sin(angles)], axis=1),
    )


def world(boxes: Boxes, k: int, own: Array) -> Array:
    """Points ``own`` (…, 3) in the frame of box ``k``, in space."""
    cos, sin = boxes.turns[k]
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    result: Array = boxes.centres[k] + own @ turn.T
    return result


def surface(boxes: Boxes, k: int, rng: np.random.Generator, count: int = 200) -> Array:
    """Points of the surface of box ``k``, its corners and edges among them."""
    own = np.clip(rng.uniform(-1.5, 1.5, (count, 3)), -1.0, 1.0)
    face = rng.integers(0, 3, count)
    own[np.arange(count), face] = rng.choice([-1.0, 1.0], count)
    return world(boxes, k, own * boxes.halves[k])


@pytest.mark.parametrize("seed", range(10))
def test_a_distance_changes_no_faster_than_the_point_moves_and_is_zero_on_the_surface(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = drawn(rng, 6)
    points = rng.uniform(-10.0, 10.0, (200, 3))
    found = distances(points, boxes)
    moved = points + rng.normal(size=points.shape) * 10.0 ** rng.uniform(-4, 1, (200, 1))
    off = np.linalg.norm(moved - points, axis=1)[:, None]
    assert (np.abs(distances(moved, boxes) - found) <= off + 1e-9).all()
    for k in range(6):
        on = surface(boxes, k, rng)
        assert np.abs(distances(on, boxes)[:, k]).max() < 1e-9
        to_surface = np.linalg.norm(points[:, None] - on, axis=-1)
        assert (np.abs(found[:, k, None]) <= to_surface + 1e-9).all()


@pytest.mark.parametrize("seed", range(5))
def test_a_distance_is_negative_exactly_inside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = drawn(rng, 4)
    for k in range(4):
        scale = rng.uniform(-1.5, 1.5, (300, 3))
        scale = scale[np.abs(np.abs(scale) - 1.0).min(axis=1) > 1e-6]
        found = distances(world(boxes, k, scale * boxes.halves[k]), boxes)[:, k]
        assert ((found < 0.0) == (np.abs(scale) < 1.0).all(axis=1)).all()


def test_a_point_that_is_unknown_has_no_distance_and_any_shape_is_kept() -> None:
    boxes = drawn(np.random.default_rng(1), 3)
    points = np.zeros((4, 2, 3))
    points[1, 1, 2] = np.nan
    found = distances(points, boxes)
    assert found.shape == (4, 2, 3)
    assert np.isnan(found[1, 1]).all()
    assert np.isfinite(np.delete(found.reshape(8, 3), 3, axis=0)).all()
    assert distances(points, boxes.chosen(np.empty(0, np.int64))).shape == (4, 2, 0)


@pytest.mark.parametrize("seed", range(10))
def test_a_place_outside_is_the_nearest_point_of_the_surface(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = drawn(rng, 5)
    for point in rng.uniform(-10.0, 10.0, (20, 3)):
        places, least = beside(point[None], boxes)
        far = distances(point, boxes)
        tall = boxes._replace(halves=np.where([0, 0, 1], 1e3, boxes.halves))
        np.testing.assert_allclose(least, np.maximum(distances(point, tall), 0.0), atol=1e-9)
        for k in np.flatnonzero(far > 0.0):
            assert np.linalg.norm(places[k, 0] - point) == pytest.approx(far[k], abs=1e-9)
            assert distances(places[k, 0], boxes)[k] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_a_place_inside_pushes_to_the_nearest_face(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = drawn(rng, 5)
    for k in range(5):
        point = world(boxes, k, rng.uniform(-0.99, 0.99, 3) * boxes.halves[k])
        away = point - beside(point[None], boxes)[0][k, 0]
        out = away / np.linalg.norm(away)
        depth = -distances(point, boxes)[k]
        assert distances(point + (depth + 1e-6) * out, boxes)[k] == pytest.approx(1e-6, abs=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_a_path_through_a_box_is_pushed_back_out_of_the_face_through_which_it_entered(seed: int) -> None:
    """Inside, and beyond a wall too thin for any point of the path to be in it."""
    rng = np.random.default_rng(seed)
    boxes = drawn(rng, 1)
    boxes.halves[0, 0] = rng.choice([0.01, 1.0])
    side = rng.choice([-1.0, 1.0])
    own = np.zeros((12, 3))
    own[:, 0] = side * np.linspace(boxes.halves[0, 0] + 3.0, -boxes.halves[0, 0] - 3.0, 12)
    own[:, 1:] = rng.uniform(-0.9, 0.9, 2) * boxes.halves[0, 1:]
    path = world(boxes, 0, own)
    places, least = beside(path, boxes)
    outward = side * np.array([*boxes.turns[0], 0.0])
    before = own[:, 0] * side > boxes.halves[0, 0]
    away = path - places[0]
    assert 0 < before.sum() < 12
    np.testing.assert_allclose(away[~before], np.tile(1e-3 * outward, ((~before).sum(), 1)), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(away[before], axis=1), distances(path[before], boxes)[:, 0])
    assert (away[before] @ outward > 0.0).all()
    assert least[0] == 0.0


@pytest.mark.parametrize("seed", range(10))
def test_a_path_that_passes_a_box_is_pushed_from_its_nearest_points_throughout(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = drawn(rng, 30)
    path = np.linspace(*rng.uniform(-10.0, 10.0, (2, 3)), 40)
    fine = np.linspace(path[0], path[-1], 4000)
    places = beside(path, boxes)[0]
    passed = np.flatnonzero(distances(fine, boxes).min(axis=0) > 0.0)
    assert len(passed)
    apart = np.linalg.norm(path - places[passed], axis=-1)
    np.testing.assert_allclose(apart, distances(path, boxes)[:, passed].T, atol=1e-9)


@pytest.mark.parametrize("count", [0, 1, 15, 16, 17, 400])
def test_the_index_finds_what_a_search_of_all_finds(count: int) -> None:
    rng = np.random.default_rng(count)
    boxes = drawn(rng, count, room=60.0)
    index = BoxIndex(boxes)
    rectangles = boxes.rectangles()
    corners = np.array(list(product((-1.0, 1.0), repeat=3)))
    for k in range(min(count, 20)):
        at = world(boxes, k, corners * boxes.halves[k])[:, :2]
        np.testing.assert_allclose(rectangles[k], [at.min(axis=0), at.max(axis=0)])
    for size in (0.0, 3.0, 30.0, 200.0):
        low = rng.uniform(-70.0, 70.0, 2)
        high = low + size
        near = (rectangles[:, 0] <= high).all(axis=1) & (rectangles[:, 1] >= low).all(axis=1)
        np.testing.assert_array_equal(index.near(low, high), np.flatnonzero(near))
