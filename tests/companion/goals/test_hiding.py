"""Laws of hidden bearings: what hides, that the way out leads out, and that nothing else turns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.obstacles import Post, Sphere
from companion.goals.hiding import Arc, fixed_occluder, hidden_arcs, vehicle_occluder, way_out
from companion.values.bearings import turned, wrapped

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
