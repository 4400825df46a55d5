"""Laws of hidden bearings: what hides, that the way out leads out, and that nothing else turns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.obstacles import Post, Sphere
from companion.goals.hiding import Arc, box_arcs, fixed_occluder, hidden_arcs, vehicle_occluder, way_out
from companion.values.bearings import turned, wrapped
from companion.values.boxes import Boxes, distances

TARGET = np.array([3.0, -2.0, 0.0])
PLACE = np.array([4.0, 0.0, 5.0])
CLEAR = 0.3
ARCS = st.lists(st.builds(Arc, st.floats(-3.1, 3.1), st.floats(0.05, 0.5)), min_size=1, max_size=5)


def post(bearing: float, distance: float, height: float = 100.0):
    at = TARGET + turned(np.array([distance, 0.0, 0.0]), bearing)
    return fixed_occluder(Post(kind="post", at=(float(at[0]), float(at[1])), radius=0.3, height=height))


def passes(bearing: float, at, radius: float) -> bool:
    """Whether the ray from the target to a camera at this bearing passes an axis so near, seen from above."""
    ray = turned(np.array([1.0, 0.0, 0.0]), bearing)[:2]
    off = np.asarray(at)[:2] - TARGET[:2]
    return bool(off @ ray > 0.0 and abs(off[0] * ray[1] - off[1] * ray[0]) < radius)


@given(st.floats(-3.1, 3.1), st.floats(0.8, 3.5), st.floats(-3.1, 3.1))
def test_an_arc_is_where_the_ray_passes_a_post(at, distance, bearing):
    occluder = post(at, distance)
    (arc,) = hidden_arcs(TARGET, PLACE, [occluder], CLEAR)
    inside = bool(abs(wrapped(np.array(bearing - arc.middle))) < arc.half - 1e-6)
    outside = bool(abs(wrapped(np.array(bearing - arc.middle))) > arc.half + 1e-6)
    if inside or outside:
        assert passes(bearing, (occluder.east, occluder.north), 0.6) is inside


@pytest.mark.parametrize("distance", [0.5, 4.0, 9.0])
def test_what_stands_at_the_target_or_behind_the_camera_hides_nothing(distance):
    assert hidden_arcs(TARGET, PLACE, [post(0.4, distance)], CLEAR) == []


def test_the_ray_passes_above_a_low_post_and_beside_a_high_ball():
    # At 2 m from the target the ray to a camera 5 m up and 4 m away is 2.5 m high.
    assert hidden_arcs(TARGET, PLACE, [post(0.0, 2.0, height=2.0)], CLEAR) == []
    assert len(hidden_arcs(TARGET, PLACE, [post(0.0, 2.0, height=3.0)], CLEAR)) == 1
    ball = Sphere(kind="sphere", at=(5.0, -2.0, 4.0), radius=0.5)
    assert hidden_arcs(TARGET, PLACE, [fixed_occluder(ball)], CLEAR) == []
    assert len(hidden_arcs(TARGET, PLACE, [vehicle_occluder(TARGET + np.array([2.0, 0.0, 2.5]))], CLEAR)) == 1


@given(st.floats(-3.1, 3.1), ARCS, st.booleans())
def test_the_way_out_leads_to_a_bearing_outside_all_arcs(bearing, arcs, left):
    def hidden(angle: float) -> bool:
        return any(abs(wrapped(np.array(angle - arc.middle))) < arc.half - 1e-6 for arc in arcs)

    turn = way_out(bearing, arcs, left=left)
    if not hidden(bearing):
        # On an edge it may be taken for inside, and is turned by a rounding error.
        assert abs(turn) < 1e-5
    elif turn:
        assert not hidden(bearing + turn)
        nearer = np.linspace(-0.95, 0.95, 39) * (abs(turn) - np.radians(1.1))
        assert all(hidden(bearing + by) for by in nearer if abs(by) < abs(turn) - np.radians(1.1))


def test_in_the_middle_each_takes_its_side():
    arcs = [Arc(0.0, 0.2)]
    assert way_out(0.0, arcs, left=True) == pytest.approx(0.2)
    assert way_out(0.0, arcs, left=False) == pytest.approx(-0.2)


def test_where_everything_is_hidden_nothing_turns():
    assert way_out(0.3, [Arc(middle, 1.5) for middle in (0.0, 2.0, 4.0)], left=True) == 0.0


def _hidden(arcs: list[Arc], bearing: float) -> bool:
    return any(abs(float(wrapped(np.array(bearing - arc.middle)))) < arc.half for arc in arcs)


@pytest.mark.parametrize("seed", range(20))
def test_boxes_hide_the_bearings_whose_ray_to_the_camera_enters_them(seed):
    """To the two degrees between rays; hanging plates and walls that reach past the camera among them."""
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-np.pi, np.pi, 4)
    boxes = Boxes(
        TARGET + rng.uniform(-6.0, 6.0, (4, 3)),
        10.0 ** rng.uniform(-1.0, 0.7, (4, 3)),
        np.stack([np.cos(angles), np.sin(angles)], axis=1),
    )
    arcs = box_arcs(TARGET, PLACE, boxes, CLEAR)
    grown = boxes._replace(halves=boxes.halves + CLEAR)
    grown = grown.chosen(np.flatnonzero(distances(TARGET, grown) > 0.0))
    shares = np.linspace(0.0, 1.0, 400)[:, None]
    fine = np.linspace(-np.pi, np.pi, 721)[:-1]
    entered = np.array(
        [distances(TARGET + shares * turned(PLACE, one), grown).min(initial=1.0) < 0.0 for one in fine]
    )
    nearby = np.stack([np.roll(entered, k) for k in range(-4, 5)])
    for bearing, all_, any_ in zip(fine, nearby.all(axis=0), nearby.any(axis=0), strict=True):
        if all_ or not any_:
            assert _hidden(arcs, bearing) is bool(all_)


def test_a_box_around_the_target_hides_nothing_and_a_closed_wall_all():
    east = np.array([[1.0, 0.0]])
    assert box_arcs(TARGET, PLACE, Boxes(TARGET[None], np.ones((1, 3)), east), CLEAR) == []
    plate = Boxes(TARGET[None] + (0.0, 0.0, 3.0), np.array([[9.0, 9.0, 0.1]]), east)
    arcs = box_arcs(TARGET, PLACE, plate, CLEAR)
    assert all(_hidden(arcs, bearing) for bearing in np.linspace(-3.1, 3.1, 50))
    assert way_out(0.5, arcs, left=True) == 0.0
