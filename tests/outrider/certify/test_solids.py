"""Least distances of curves from fixed obstacles, against dense samples measured by another program."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.obstacles import Box, Obstacle, Post, Sphere, Wall
from companion.values.horizon import Array
from outrider.certify.solids import TOLERANCE, Solids
from outrider.runs.surfaces import Surfaces

_at = st.floats(-4.0, 4.0)
_size = st.floats(0.05, 4.0)
_place = st.tuples(_at, _at, _at)
_SAMPLES = 201
obstacles = st.one_of(
    st.builds(Sphere, kind=st.just("sphere"), at=_place, radius=_size),
    st.builds(Post, kind=st.just("post"), at=st.tuples(_at, _at), radius=_size, height=_size),
    st.builds(
        Box,
        kind=st.just("box"),
        at=_place,
        size=st.tuples(_size, _size, _size),
        yaw_deg=st.floats(-360.0, 360.0),
    ),
    st.builds(
        Wall,
        kind=st.just("wall"),
        ends=st.tuples(st.tuples(_at, _at), st.tuples(_at, st.floats(5.0, 9.0))),
        thickness=_size,
        height=_size,
    ),
)
"""One fixed obstacle."""
_points = st.lists(_place, min_size=3, max_size=3)
curves = st.lists(_points, min_size=1, max_size=4).map(lambda found: np.array(found, dtype=np.float64))
"""Control points (n, 3, 3) of segments, which need not meet."""


def sampled(points: Array, obstacle: Obstacle, count: int = _SAMPLES) -> float:
    """Least distance (m) of ``count`` points on each segment, negative inside."""
    s = np.linspace(0.0, 1.0, count)
    weights = np.stack([(1.0 - s) ** 2, 2.0 * s * (1.0 - s), s**2], axis=1)
    places = (weights @ points).reshape(-1, 1, 3)
    return float(Surfaces([obstacle]).distance(places, np.array([0])).min())


def longest(points: Array) -> float:
    """Bound of the speed (m per segment) on all segments."""
    return 2.0 * float(np.linalg.norm(np.diff(points, axis=1), axis=2).max())


@given(curves, obstacles)
def test_the_least_distance_is_that_of_dense_samples(points: Array, obstacle: Obstacle) -> None:
    found = Solids([obstacle]).least(points, np.array([0]), 100.0)
    apart = sampled(points, obstacle)
    # A sample is never nearer, and the curve between two of them is nearer by half a step at most.
    assert found.distance[0] - TOLERANCE <= apart + 1e-9
    assert apart <= found.distance[0] + 0.5 * longest(points) / (_SAMPLES - 1) + 1e-9
    assert found.hull[0] <= apart + 1e-9


@given(curves, obstacles)
def test_the_place_of_the_least_distance_is_on_the_curve(points: Array, obstacle: Obstacle) -> None:
    found = Solids([obstacle]).least(points, np.array([0]), 100.0)
    s = float(found.share[0])
    q = points[found.segment[0]]
    place = (1.0 - s) ** 2 * q[0] + 2.0 * s * (1.0 - s) * q[1] + s**2 * q[2]
    there = float(Surfaces([obstacle]).distance(place[None], np.array([0]))[0])
    assert there == pytest.approx(found.distance[0], abs=1e-9)


@given(_place, obstacles)
def test_a_plan_at_rest_has_the_distance_of_its_place(place: tuple[float, ...], obstacle: Obstacle) -> None:
    points = np.tile(np.array(place), (2, 3, 1))
    found = Solids([obstacle]).least(points, np.array([0]), 100.0)
    there = float(Surfaces([obstacle]).distance(points[0, :1], np.array([0]))[0])
    assert found.distance[0] == pytest.approx(there, abs=1e-9)
    if there > 1e-6:
        assert found.hull[0] == pytest.approx(there, abs=1e-9)


@given(curves, st.lists(obstacles, min_size=1, max_size=6), st.floats(0.1, 3.0))
def test_what_is_near_is_what_a_search_of_all_finds(
    points: Array, known: list[Obstacle], within: float
) -> None:
    """Obstacles that the search leaves out are further away, and the others have the same distances."""
    solids = Solids(known)
    whole = solids.least(points, np.arange(len(known)), 100.0)
    near = solids.near(points.min(axis=(0, 1)), points.max(axis=(0, 1)), within)
    found = dict(zip(near.tolist(), solids.least(points, near, within).distance.tolist(), strict=True))
    for row, distance in enumerate(whole.distance.tolist()):
        if distance < within:
            assert found[row] == pytest.approx(distance, abs=2.0 * TOLERANCE)
        else:
            assert found.get(row, np.inf) >= within - 2.0 * TOLERANCE


@given(_place, obstacles)
def test_below_is_the_nearest_of_all_heights_from_a_place_down(
    place: tuple[float, float, float], obstacle: Obstacle
) -> None:
    found = Solids([obstacle]).below(np.array(place), np.array([0]))[0]
    heights = np.linspace(place[2], -60.0, 4001)
    column = np.stack([np.full(4001, place[0]), np.full(4001, place[1]), heights], axis=1)[:, None]
    least = max(0.0, float(Surfaces([obstacle]).distance(column, np.array([0])).min()))
    assert found - 1e-9 <= least <= found + (heights[0] - heights[1])
