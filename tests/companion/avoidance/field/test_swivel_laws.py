"""The swivel's laws: it goes with what is left of the way, and on the surface nothing is left of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.avoidance.field.dqmpc import Dqmpc
from companion.avoidance.field.methods import Influence
from companion.avoidance.field.methods.swivel import Swivel
from companion.avoidance.field.planner import Aim, Planner
from companion.surfaces import Cylinder, Sphere, Surface
from tests.companion.rig import CIRCLE, LAWS, QUICK, ZERO, numbers, obstacles, scene, vectors
from tests.companion.swarm import AHEAD, DT, METHODS, OTHER, START, STEPS, configured, escort, fly

ROUND: list[Surface] = [CIRCLE, Cylinder(kind="cylinder"), Sphere(kind="sphere", radius=5.0)]
"""On which a turn about the vertical by an angle goes no further than that times the radius."""
WIDEST = 5.0


@LAWS
@given(offset=vectors(9.0), other=vectors(9.0), surface=st.sampled_from(ROUND))
def test_the_swivel_goes_with_the_way_that_is_left(offset, other, surface):
    """A vehicle that hovers: ∇J is twice the way, and a little for the last input."""
    config = configured("swivel", "own")
    target = np.array([1.0, -2.0, 0.0])
    seen = scene(target + offset, obstacles([target + other]), surface=surface, target=target)
    way = float(np.linalg.norm(seen.to_go))
    gradient = Dqmpc(config.horizon, config.cost, config.limits).gradient(
        np.zeros((STEPS, 3)), seen.position, ZERO, seen.destination, ZERO
    )
    nothing = Influence(np.zeros((STEPS, 3)), 1.0, seen.destination)
    swivelled = Swivel(config.swivel, "own").influence(seen._replace(gradient=gradient), nothing).destination
    assert np.linalg.norm(swivelled - seen.destination) <= 2.02 * config.swivel.k_s * way * WIDEST + 1e-6


@QUICK
@given(
    offset=vectors(9.0),
    aside=numbers(0.8, 2.0),
    speed=vectors(1.0),
    surface=st.sampled_from(ROUND),
    name=st.sampled_from(list(METHODS)),
    sense=st.sampled_from(["own", "right", "left"]),
)
def test_who_is_on_the_surface_stays_there(offset, aside, speed, surface, name, sense):
    """And goes with the target, whoever goes along beside it out of d_safe."""
    place, planner = surface.nearest(offset), Planner(configured(name, sense))
    assume(np.hypot(*place[:2]) > 0.1)
    c, s = np.cos(aside), np.sin(aside)
    other = place @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    assume(np.linalg.norm(other - place) > 3.0)
    speed = speed * [1.0, 1.0, 0.0]
    ahead = 1e-6 * DT * np.arange(STEPS)[:, None] * speed
    for k in range(5):
        target = np.array([1.0, -2.0, 0.0]) + 1e-6 * DT * k * speed
        here, end = target + place, target + AHEAD * speed
        aim = Aim(end + surface.nearest(place), speed, target, end, surface)
        others = obstacles([target + other], [speed])
        plan = planner.plan(START + k * DT, here, speed, here + ahead, aim, others)
        knots = plan.horizon.knots
        np.testing.assert_allclose(knots[:STEPS, 0:3], here + ahead, atol=1e-6)
        np.testing.assert_allclose(knots[:, 3:6], np.tile(speed, (STEPS + 1, 1)), atol=1e-6)
        np.testing.assert_allclose(plan.gradient, ZERO, atol=1e-6)


@pytest.mark.parametrize("sense", OTHER)
@pytest.mark.parametrize("name", ["swivel", "both"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_ring_that_swivelled_comes_to_rest(name, sense, seed):
    """Bearings from the target turn on the way, and not at all on the surface, where ∇J is zero."""
    swarm = escort(seed)._replace(speed=ZERO, ball=np.array([0.0, 0.0, -50.0]))
    places, gradients = fly(configured(name, sense), swarm, seconds=25.0)
    off = places - swarm.target
    bearing = np.unwrap(np.arctan2(off[..., 1], off[..., 0]), axis=0)
    rate = np.abs(np.diff(bearing, axis=0)) / (1e-6 * DT)
    assert rate.max() > 0.1
    np.testing.assert_allclose(off[-1], CIRCLE.nearest(off[-1]), atol=0.01)
    assert rate[-10:].max() < 1e-3
    assert gradients[-1].max() < 0.01
