"""The field's distances grow with how wrong estimates are: k·σ of the error of the distance."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from companion.avoidance.field.planner import Planner, standing
from companion.config import CompanionConfig
from companion.values.obstacles import Obstacles
from companion.world import World, reach
from mavlink_bridge.messages import GlobalPosition, Source
from tests.companion.bench import FLEET

NOW = 10_000_000
OWN, OTHER, TARGET = 11, 12, 1
HERE = np.broadcast_to([0.0, 0.0, 5.0], (16, 3))
SIGMAS, TIMES = st.floats(0.0, 5.0), st.floats(0.0, 6.0)


def settings(sigma, k):
    return CompanionConfig.model_validate(
        {
            "field": {"position_sigma": sigma, "margin_sigmas": k},
            "target_d_min": 1.0,
            "target_d_safe": 4.0,
            "obstacles": [{"kind": "sphere", "at": [3.0, 0.0, 5.0], "radius": 0.7}],
        }
    )


def told(system, east):
    latitude, longitude, altitude = FLEET.to_geodetic(np.array([east, 0.0, 5.0]))
    return GlobalPosition(Source(system, 1), 0, latitude, longitude, altitude, 5.0, (0.0, 0.0, 0.0), None)


def seen(config):
    """A neighbour, the target and a sphere, as the planner is given them."""
    world = World(config, OWN, TARGET, FLEET)
    world.receive(NOW, "swarm", told(OTHER, 2.0))
    world.receive(NOW, "target", told(TARGET, -2.0))
    found = world.obstacles(NOW, world.at(NOW), HERE)
    assert found.ids[:2] == (OTHER, TARGET)
    assert len(found.ids) == 3
    return found


@given(sigma=SIGMAS, k=TIMES)
def test_every_distance_grows_by_k_sigma_of_its_own_error(sigma, k):
    """Two estimates lie between vehicles, one between a vehicle and what stands."""
    exact, wrong = seen(settings(0.0, k)), seen(settings(sigma, k))
    grown = k * sigma * np.sqrt([2.0, 2.0, 1.0])
    for before, after in (
        (exact.d_min, wrong.d_min),
        (exact.d_safe, wrong.d_safe),
        (exact.radius, wrong.radius),
    ):
        assert_allclose(after - before, grown, atol=1e-12)


@given(sigma=SIGMAS, k=TIMES)
def test_what_acts_on_the_vehicle_is_among_what_is_asked_for(sigma, k):
    config = settings(sigma, k)
    found = seen(config)
    assert reach(config) >= float(found.d_safe[2] - config.obstacles[0].radius) - 1e-12


def test_the_error_of_a_distance_is_that_of_two_positions():
    """The share of pairs whose distance is wrong by more than the margin is that of k standard deviations."""
    field = settings(0.4, 2.0).field
    errors = np.random.default_rng(1).normal(0.0, 0.4, (200_000, 2))
    beyond = float(np.mean(errors[:, 0] - errors[:, 1] > field.margin(2)))
    assert beyond == pytest.approx(0.02275, abs=0.002)


def test_without_an_error_nothing_grows():
    found = seen(settings(0.0, 2.0))
    field = CompanionConfig().field
    assert found.d_min.tolist() == [field.d_min, 1.0, field.d_min + 0.7]


@given(sigma=SIGMAS, k=TIMES)
def test_the_box_is_smaller_by_k_sigma_and_never_nothing(sigma, k):
    limits, margin = settings(sigma, k).limits, k * sigma
    low, high = np.array(limits.box_min), np.array(limits.box_max)
    inner = limits.within(margin)
    off = np.array(inner.box_min) - low
    assert_allclose(high - np.array(inner.box_max), off, atol=1e-12)
    assert (off <= margin + 1e-12).all()
    assert_allclose(off, np.minimum(margin, (high - low) / 4.0), atol=1e-12)


@pytest.mark.parametrize("sigma", [0.0, 0.6])
def test_who_is_sent_to_the_floor_stays_k_sigma_above_it(sigma):
    config = settings(sigma, 2.0)
    planner, prediction = Planner(config), np.broadcast_to([0.0, 0.0, 6.0], (16, 3))
    position, velocity, now = np.array([0.0, 0.0, 6.0]), np.zeros(3), NOW
    floor = config.limits.box_min[2] + 2.0 * sigma
    for _ in range(80):
        nobody = Obstacles((), np.zeros((0, 16, 3)), np.zeros(0), np.zeros(0))
        plan = planner.plan(now, position, velocity, prediction, standing(np.array([3.0, 0.0, 0.0])), nobody)
        now += config.horizon.dt_us
        motion, prediction = plan.horizon.at(now), plan.horizon.knots[:16, 0:3]
        position, velocity = motion.position, motion.velocity
        assert position[2] >= floor - 1e-6
    assert position[2] < floor + 0.05
