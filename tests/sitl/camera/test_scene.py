"""Laws of what a camera may see: places between messages, and bodies between eye and point."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mavlink_bridge.messages import HilState, Source
from sitl.camera.occlusion import Ball, Blocks, Body, Column, Point
from sitl.camera.scene import Scene, Sightings
from tests.sitl.autopilot_rig import SITE

coordinate = st.floats(-20.0, 20.0)
points = st.tuples(coordinate, coordinate, coordinate)


def sighting(system: int, time: int, place: tuple[float, float, float]) -> HilState:
    return HilState(Source(system, 1), time, *SITE.to_geodetic(place), (0.0, 0.0, 0.0))


def seen(*times: int) -> Sightings:
    """A body that moves at 10 m/s towards east, as told at ``times``."""
    found = Sightings(Scene(10, (), {12: Ball((0.0, 0.0, 0.0), 0.3)}), SITE)
    for time in times:
        found.receive(sighting(12, time, (1e-5 * time, 2.0, 3.0)))
    return found


@given(st.integers(0, 250_000))
def test_a_place_between_messages_is_on_the_straight_line_between_them(time: int) -> None:
    place = seen(0, 50_000, 100_000, 150_000, 200_000).place(12, time)
    assert place == pytest.approx((2.0, 1e-5 * time, -3.0), abs=1e-6)


def test_a_body_that_says_nothing_is_not_there() -> None:
    told = seen(100_000, 150_000, 900_000)
    assert told.place(12, 90_000) is None
    assert told.place(12, 500_000) is None
    assert told.place(12, 1_100_000) is None
    assert told.place(13, 100_000) is None
    assert [body for body in told.bodies(120_000) if isinstance(body, Ball)] != []
    assert told.bodies(500_000) == []


def test_messages_out_of_order_and_of_others_are_ignored() -> None:
    told = seen(100_000, 150_000, 120_000)
    told.receive(sighting(77, 150_000, (0.0, 0.0, 0.0)))
    assert told.place(12, 120_000) == pytest.approx((2.0, 1.2, -3.0), abs=1e-6)
    assert told.place(77, 150_000) is None


def depth(body: Body, eye: Point, point: Point) -> float:
    """How deep (m) the line from ``eye`` to ``point`` reaches into a body; negative if it passes by."""
    line = np.linspace(eye, point, 4001)
    if isinstance(body, Ball):
        return body.radius - float(np.linalg.norm(line - body.centre, axis=1).min())
    if isinstance(body, Blocks):
        return max(deep_in(line, *parts) for parts in zip(body.centres, body.halves, body.turns, strict=True))
    assert isinstance(body, Column)
    inside = body.radius - np.linalg.norm(line[:, :2] - body.axis, axis=1)
    return float(np.minimum(inside, line[:, 2] - body.top).max())


def deep_in(line: np.ndarray, centre: np.ndarray, half: np.ndarray, turn: np.ndarray) -> float:
    """How deep (m) some of the points of ``line`` (n, 3) are in a box."""
    along = np.array([turn[0], turn[1], 0.0])
    axes = np.array([along, [-along[1], along[0], 0.0], [0.0, 0.0, 1.0]])
    return float((half - np.abs((line - centre) @ axes.T)).min(axis=1).max())


def blocks(found: list[tuple[Point, Point, float]]) -> Blocks:
    """Boxes with their centres, half sizes and headings (rad)."""
    centres, halves, headings = zip(*found, strict=True)
    turns = np.stack([np.cos(headings), np.sin(headings)], axis=1)
    return Blocks(np.array(centres), np.array(halves), turns)


half = st.floats(0.1, 5.0)
bodies = st.one_of(
    st.lists(
        st.tuples(points, st.tuples(half, half, half), st.floats(-4.0, 4.0)), min_size=1, max_size=4
    ).map(blocks),
    st.builds(Ball, points, st.floats(0.1, 5.0)),
    st.builds(Column, st.tuples(coordinate, coordinate), st.floats(0.1, 5.0), coordinate),
)


@given(bodies, points, points)
def test_a_body_hides_a_point_if_and_only_if_the_line_to_it_is_in_the_body(body, eye, point) -> None:
    deepest = depth(body, eye, point)
    # The samples are up to 1.8 cm apart.
    assume(abs(deepest) > 0.02)
    assert body.hides(eye, point) == (deepest > 0.0)


@given(bodies, points, points, st.tuples(coordinate, coordinate, st.just(0.0)))
def test_hiding_does_not_depend_on_the_origin(body, eye, point, by) -> None:
    moved = [tuple(a + b for a, b in zip(one, by, strict=True)) for one in (eye, point)]
    assume(abs(depth(body, eye, point)) > 0.02)
    assert body.moved(by).hides(*moved) == body.hides(eye, point)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("aside", [-1.0, -0.99, 0.0, 0.99, 1.0])
def test_a_line_along_an_axis_crosses_a_box_between_its_sides(axis: int, aside: float) -> None:
    box = blocks([((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.0)])
    eye, point = [aside] * 3, [aside] * 3
    eye[axis], point[axis] = -3.0, 3.0
    assert box.hides((eye[0], eye[1], eye[2]), (point[0], point[1], point[2])) == (abs(aside) < 1.0)


@given(st.lists(st.tuples(points, st.tuples(half, half, half), st.floats(-4.0, 4.0)), min_size=2, max_size=4))
def test_boxes_hide_what_any_of_them_hides(found) -> None:
    eye, point = (-15.0, 1.0, -2.0), (15.0, -2.0, 3.0)
    assert blocks(found).hides(eye, point) == any(blocks([one]).hides(eye, point) for one in found)
