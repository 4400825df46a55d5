"""Fixed obstacles: distances are those of their surfaces, and what is near is found."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.avoidance.field.forces import repulsion
from companion.config import CompanionConfig
from companion.config.obstacles import Box, Post, Sphere, Wall
from companion.obstacles.static import FIRST_ID, FixedObstacles
from companion.world import World, reach
from mavlink_bridge.frames import FleetFrame
from tests.companion.rig import LAWS, numbers, vectors

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
NOW = 1_767_225_600_000_000
HEIGHT = 6.0

spheres = st.builds(
    lambda at, radius: Sphere(kind="sphere", at=tuple(at.tolist()), radius=radius),
    vectors(10.0),
    numbers(0.1, 3.0),
)
posts = st.builds(
    lambda at, radius: Post(kind="post", at=tuple(at[:2].tolist()), radius=radius, height=HEIGHT),
    vectors(10.0),
    numbers(0.1, 3.0),
)
boxes = st.builds(
    lambda at, size, yaw: Box(kind="box", at=tuple(at.tolist()), size=size, yaw_deg=yaw),
    vectors(10.0),
    st.tuples(numbers(0.1, 6.0), numbers(0.1, 6.0), numbers(0.1, 6.0)),
    numbers(-180.0, 180.0),
)
walls = st.builds(
    lambda one, x, y: Wall(kind="wall", ends=((one[0], one[1]), (one[0] + x, one[1] + y)), height=HEIGHT),
    vectors(5.0).map(np.ndarray.tolist),
    numbers(0.5, 8.0),
    numbers(-8.0, 8.0),
)
round_ = st.one_of(spheres, posts)
flat = st.one_of(boxes, walls)
either = st.one_of(round_, flat)


@given(spheres, vectors(12.0))
def test_a_sphere_s_distance_is_that_of_its_centre_less_its_radius(sphere, point):
    expected = np.linalg.norm(point - sphere.at) - sphere.radius
    assert FixedObstacles((sphere,)).distance(point)[0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("point", "distance"),
    [
        ((3.0, 0.0, 2.0), 2.0),  # beside
        ((0.5, 0.0, 7.0), 1.0),  # above
        ((4.0, 0.0, 10.0), 5.0),  # above and beside: to the edge
        ((0.0, 0.0, 5.5), -0.5),  # inside, nearer to the top
        ((0.8, 0.0, 2.0), -0.2),  # inside, nearer to the side
    ],
)
def test_a_post_has_a_flat_top(point, distance):
    post = Post(kind="post", at=(0.0, 0.0), radius=1.0, height=HEIGHT)
    assert FixedObstacles((post,)).distance(np.array(point))[0] == pytest.approx(distance)


@LAWS
@given(st.lists(either, min_size=1, max_size=5), vectors(12.0), vectors(1.0))
def test_distance_changes_no_faster_than_one_moves(obstacles, point, step):
    fixed = FixedObstacles(tuple(obstacles))
    change = fixed.distance(point + step) - fixed.distance(point)
    assert (np.abs(change) <= np.linalg.norm(step) + 1e-9).all()


@LAWS
@given(st.lists(either, min_size=1, max_size=6), vectors(12.0), vectors(3.0), numbers(0.0, 8.0))
def test_nothing_within_reach_is_overlooked(obstacles, here, velocity, far):
    prediction = here + 0.1 * np.arange(16)[:, None] * velocity
    fixed = FixedObstacles(tuple(obstacles))
    near = fixed.around(prediction, far)
    within = fixed.distance(prediction).min(axis=0) <= far
    assert {FIRST_ID + k for k in np.flatnonzero(within)} <= set(near.ids)
    assert near.positions.shape == (len(near.ids), 16, 3)


@LAWS
@given(round_, vectors(12.0))
def test_the_axis_less_the_radius_never_overstates_the_distance(obstacle, here):
    """What the field sees is never further than what is there."""
    fixed = FixedObstacles((obstacle,))
    axes = fixed.around(here[None], 1e4)
    seen = np.linalg.norm(here - axes.positions[0, 0]) - axes.radius[0]
    assert seen <= max(fixed.distance(here)[0], 0.0) + 1e-9


@given(walls, vectors(12.0))
def test_a_wall_is_the_box_between_its_ends(wall, point):
    """A point is as far from it as from the line between the ends, less half of the thickness, beside it."""
    (one, two), fixed = np.array(wall.ends), FixedObstacles((wall,))
    along = (two - one) / np.linalg.norm(two - one)
    share = (point[:2] - one) @ along
    across = abs((point[:2] - one) @ (along[1], -along[0]))
    point[2] = 0.5 * HEIGHT
    if 0.0 < share < np.linalg.norm(two - one) and across > 0.5 * wall.thickness:
        assert fixed.distance(point)[0] == pytest.approx(across - 0.5 * wall.thickness, abs=1e-9)
    ends = np.array([[*one, 0.0], [*two, 0.0], [*one, HEIGHT], [*two, HEIGHT]])
    np.testing.assert_allclose(fixed.distance(ends), 0.0, atol=1e-9)


@LAWS
@given(flat, vectors(12.0), vectors(1e-4))
def test_the_field_of_a_box_pushes_where_the_distance_from_its_surface_grows(box, here, step):
    config = CompanionConfig(obstacles=(box,))
    picture, fixed = World(config, 11, 1, FLEET), FixedObstacles((box,))
    prediction = np.broadcast_to(here, (16, 3))
    seen = picture.obstacles(NOW, picture.at(NOW), prediction)
    distance = float(fixed.distance(here)[0])
    assume(abs(distance) > 1e-2)
    if not seen.ids:
        assert distance > reach(config)
        return
    assert seen.d_min[0] == config.field.d_min
    force = repulsion(prediction, seen, 10.0, 7.0, None, 0.1)[0]
    assert (np.linalg.norm(force) > 0.0) == (distance < config.field.d_safe)
    if distance < config.field.d_safe - 1e-6:
        away = force / np.linalg.norm(force)
        # The gradient of a distance: of all directions it grows the fastest in this one, at the rate 1.
        assert fixed.distance(here + 1e-4 * away)[0] == pytest.approx(distance + 1e-4, abs=1e-9)
        assert fixed.distance(here + step)[0] <= distance + np.linalg.norm(step) + 1e-9


@given(posts, vectors(12.0))
def test_beside_a_post_the_field_is_horizontal_and_away(post, here):
    here[2] = 0.5 * HEIGHT
    config = CompanionConfig(obstacles=(post,))
    picture = World(config, 11, 1, FLEET)
    prediction = np.broadcast_to(here, (16, 3))
    seen = picture.obstacles(NOW, picture.at(NOW), prediction)
    away = here - (*post.at, here[2])
    distance = float(np.linalg.norm(away))
    assume(distance > 1e-3)
    if seen.ids:
        assert seen.d_min[0] == config.field.d_min + post.radius
        force = repulsion(prediction, seen, 10.0, 7.0, None, 0.1)[0]
        assert force[2] == pytest.approx(0.0, abs=1e-9)
        assert force @ away >= -1e-9
        inside = distance < config.field.d_safe + post.radius - 1e-6
        assert (np.linalg.norm(force) > 0.0) == inside
    else:
        assert distance - post.radius > reach(config) - 1e-9
