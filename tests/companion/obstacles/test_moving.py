"""Obstacles that move: at rest they act as fixed ones do, and what is heard of them is where they are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from companion.avoidance.field.forces import repulsion
from companion.config.companion import CompanionConfig, MovingPost, MovingSphere, Post, Sphere
from companion.obstacles.moving import MovingObstacles
from companion.obstacles.static import FixedObstacles
from companion.telemetry.sharing import plan_message
from companion.values.horizon import roll_out
from companion.world import World
from mavlink_bridge.frames import FleetFrame, enu_to_ned
from mavlink_bridge.messages import GlobalPosition, Source
from tests.companion.rig import LAWS, ZERO, numbers, vectors

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
NOW = 1_767_225_600_000_000
OWN, TARGET, SYSTEM = 11, 1, 190
DELAY = CompanionConfig().neighbour.delay_us
HEIGHT = 6.0
FIELD = {"position_sigma": 0.02}

radii = numbers(0.1, 3.0)
kinds = st.sampled_from(["sphere", "post"])


def told(x, v=ZERO, system=SYSTEM):
    latitude, longitude, altitude = FLEET.to_geodetic(x)
    ned = tuple(float(part) for part in enu_to_ned(v))
    return GlobalPosition(Source(system, 1), 0, latitude, longitude, altitude, 0.0, ned, None)


def place(x):
    """Where that is after its way over the wire's geodetic coordinates and back."""
    return FLEET.to_enu(*FLEET.to_geodetic(x))


def moving(kind, radius, system=SYSTEM):
    if kind == "sphere":
        return MovingSphere(kind="sphere", system=system, radius=radius)
    return MovingPost(kind="post", system=system, radius=radius, height=HEIGHT)


def fixed(kind, at, radius):
    if kind == "sphere":
        return Sphere(kind="sphere", at=tuple(at.tolist()), radius=radius)
    return Post(kind="post", at=tuple(at[:2].tolist()), radius=radius, height=HEIGHT)


def seen(prediction, *messages, now=NOW, **config):
    """What a companion with that ``config`` is told to avoid along its ``prediction``."""
    world = World(CompanionConfig.model_validate({"field": FIELD, **config}), OWN, TARGET, FLEET)
    for message in messages:
        world.receive(now + DELAY, "swarm", message)
    return world.obstacles(now, world.at(now), prediction)


def straight(here, velocity):
    return here + 0.1 * np.arange(16.0)[:, None] * velocity


def field(prediction, obstacles):
    return repulsion(prediction, obstacles, 10.0, 140.0, 4.0, 0.1)


@LAWS
@given(kinds, vectors(8.0), radii, vectors(9.0), vectors(2.5))
def test_at_rest_it_acts_as_a_fixed_one_of_its_place_and_size(kind, at, radius, here, velocity):
    prediction = straight(here, velocity)
    mobile = seen(prediction, told(at), moving=(moving(kind, radius),))
    stands = seen(prediction, obstacles=(fixed(kind, place(at), radius),))
    assert mobile.ids == (SYSTEM,)
    if not stands.ids:
        # Too far away to act, in the field or the band.
        np.testing.assert_array_equal(field(prediction, mobile), 0.0)
        return
    np.testing.assert_allclose(mobile.positions, stands.positions, atol=1e-12)
    for part in ("d_min", "d_safe", "radius"):
        np.testing.assert_array_equal(getattr(mobile, part), getattr(stands, part))
    np.testing.assert_allclose(field(prediction, mobile), field(prediction, stands), rtol=1e-9, atol=1e-9)


@LAWS
@given(vectors(6.0), radii, vectors(7.0), vectors(3.0), vectors(1.5), st.booleans())
def test_beside_a_post_the_force_is_horizontal(at, radius, here, velocity, drift, plan):
    """Whatever height it says that it is at, and whether it says where it will be."""
    here[2] = 0.5 * HEIGHT
    velocity[2] = drift[2] = 0.0
    messages = [told(at, drift)]
    if plan:
        horizon = roll_out(NOW, 100_000, at, drift, np.zeros((16, 3)))
        messages.append(plan_message(horizon, Source(SYSTEM, 1), FLEET))
    prediction = straight(here, velocity)
    found = seen(prediction, *messages, moving=(moving("post", radius),))
    np.testing.assert_array_equal(found.positions[0, :, 2], 0.5 * HEIGHT)
    np.testing.assert_array_equal(field(prediction, found)[:, 2], 0.0)


def test_above_a_post_the_force_points_up():
    here = np.array([0.0, 0.0, HEIGHT + 2.0])
    prediction = straight(here, ZERO)
    force = field(prediction, seen(prediction, told(ZERO), moving=(moving("post", 0.5),)))
    np.testing.assert_allclose(force[:, :2], 0.0, atol=1e-6)
    assert (force[:, 2] > 0.0).all()


@LAWS
@given(kinds, vectors(6.0), radii, radii, vectors(8.0), vectors(3.0))
def test_the_larger_it_is_the_harder_it_pushes(kind, at, one, other, here, velocity):
    prediction = straight(here, velocity)
    off = here[:2] - at[:2]
    assume(off @ off > 1e-6)
    pushes = [
        np.linalg.norm(field(prediction, seen(prediction, told(at), moving=(moving(kind, radius),))), axis=1)
        for radius in sorted((one, other))
    ]
    assert (pushes[0] <= pushes[1] + 1e-9).all()


@LAWS
@given(vectors(20.0), vectors(3.0), st.lists(vectors(2.0), min_size=16, max_size=16).map(np.array))
def test_with_a_plan_it_is_where_that_says_and_without_where_it_was_heard(x, v, a):
    horizon = roll_out(NOW, 100_000, x, v, a)
    prediction = straight(ZERO, ZERO)
    known = (moving("sphere", 0.8),)
    plan = plan_message(horizon, Source(SYSTEM, 1), FLEET)
    with_plan = seen(prediction, told(x, v), plan, moving=known).positions[0]
    np.testing.assert_allclose(with_plan, horizon.positions(NOW, 16, 100_000), atol=0.01)
    held = seen(prediction, told(x, v), moving=known).positions[0]
    np.testing.assert_allclose(held, np.broadcast_to(x, (16, 3)), atol=0.02)
    carried = seen(prediction, told(x, v), moving=known, neighbour_prediction="velocity").positions[0]
    np.testing.assert_allclose(carried, straight(x, v), atol=0.05)


@LAWS
@given(kinds, radii, vectors(4.0), st.integers(0, 20_000_000))
def test_who_falls_silent_may_be_as_far_off_as_a_vehicle_and_keeps_its_size(kind, radius, v, age):
    """It is larger than a vehicle by the same, whatever is known of where it is."""
    prediction, now = straight(ZERO, ZERO), NOW + age
    found = []
    for things in ((), (moving(kind, radius),)):
        settings = {"field": FIELD, "guard": {"flown_on_us": 3_000_000}, "moving": things}
        world = World(CompanionConfig.model_validate(settings), OWN, TARGET, FLEET)
        world.receive(NOW + DELAY, "swarm", told(ZERO, v))
        found.append(world.obstacles(now, world.at(now), prediction))
    vehicle, thing = found
    field = world.config.field
    larger = radius + field.margin(1) - field.margin(2)
    np.testing.assert_array_equal(thing.positions[..., :2], vehicle.positions[..., :2])
    for part in ("d_min", "d_safe", "radius"):
        np.testing.assert_allclose(getattr(thing, part), getattr(vehicle, part) + larger, atol=1e-12)


def test_neighbours_beside_it_stay_vehicles():
    prediction = straight(np.array([0.0, 0.0, 5.0]), ZERO)
    messages = [told(np.array([2.0, 0.0, 5.0]), system=12), told(np.array([-2.0, 0.0, 5.0]))]
    messages.append(told(np.array([0.0, 3.0, 5.0]), system=13))
    alone = seen(prediction, *messages)
    among = seen(prediction, *messages, moving=(moving("post", 0.7), moving("sphere", 1.0, 77)))
    assert among.ids == alone.ids == (12, SYSTEM, 13)
    config = CompanionConfig.model_validate({"field": FIELD}).field
    for k in (0, 2):
        np.testing.assert_array_equal(among.positions[k], alone.positions[k])
        assert (among.d_min[k], among.d_safe[k]) == (alone.d_min[k], alone.d_safe[k])
        assert among.radius[k] == config.margin(2)
    assert among.radius[1] == 0.7 + config.margin(1)
    assert among.d_min[1] == config.d_min + among.radius[1]
    assert among.d_safe[1] == config.d_safe + among.radius[1]


def test_who_has_a_size_and_says_nothing_is_not_there():
    prediction = straight(ZERO, ZERO)
    assert seen(prediction, moving=(moving("sphere", 1.0),)).ids == ()


@LAWS
@given(st.lists(st.tuples(kinds, vectors(8.0), radii), min_size=1, max_size=4), vectors(10.0), vectors(10.0))
def test_distances_are_those_of_fixed_ones_at_every_instant(things, one, other):
    sizes = MovingObstacles(tuple(moving(kind, r, 190 + k) for k, (kind, _, r) in enumerate(things)))
    points = np.array([[one, other], [other, one], [one, one]])
    drift = np.array([0.0, 1.0, -2.0])[:, None, None] * np.array([1.0, -0.5, 0.25])
    places = np.array([at for _, at, _ in things]) + drift
    found = sizes.distance(points, places)
    assert found.shape == (3, 2, len(things))
    for t in range(3):
        stand = [fixed(kind, at, r) for (kind, _, r), at in zip(things, places[t], strict=True)]
        np.testing.assert_allclose(found[t], FixedObstacles(tuple(stand)).distance(points[t]), atol=1e-12)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ([{"system": 190, "kind": "ball", "radius": 1.0}], "kind"),
        ([{"system": 255, "kind": "sphere", "radius": 1.0}], "254"),
        ([{"system": 190, "kind": "sphere", "radius": 0.0}], "greater than 0"),
        ([{"system": 190, "kind": "sphere", "radius": 1.0, "height": 3.0}], "not permitted"),
        ([{"system": 190, "kind": "sphere", "radius": 1.0}] * 2, "system 190 is there twice"),
    ],
)
def test_what_cannot_be_is_refused(wrong, said):
    with pytest.raises(ValidationError, match=said):
        CompanionConfig.model_validate({"moving": wrong})
