"""The swivelling destination: how far it turns, to which side, and that nothing is left of it on arrival."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.avoidance.field.methods import Influence
from companion.avoidance.field.methods.swivel import Swivel
from companion.config.planning import SwivelConfig
from companion.surfaces import Ellipsoid
from tests.companion.rig import CIRCLE, LAWS, TARGET, numbers, obstacles, scene, vectors

CONFIG = SwivelConfig()
MIRROR = np.diag([1.0, -1.0, 1.0])
SURFACES = st.sampled_from([CIRCLE, Ellipsoid(kind="ellipsoid"), None])


def turned(seen, method=None):
    start = Influence(np.zeros((16, 3)), 1.0, seen.destination)
    influence = (method or Swivel(CONFIG, "own")).influence(seen, start)
    assert influence.force is start.force
    assert influence.omega_scale == 1.0
    return influence.destination


def bearing(point, centre):
    return np.arctan2(point[1] - centre[1], point[0] - centre[0])


def angle(after, before, centre):
    """By how much a destination was turned about the target, rad."""
    return (bearing(after, centre) - bearing(before, centre) + np.pi) % (2 * np.pi) - np.pi


@LAWS
@given(place=vectors(12.0), other=vectors(12.0), gradient=vectors(20.0), velocity=vectors(2.0))
def test_it_turns_by_k_s_times_the_gradient_and_at_most_a_quarter(place, other, gradient, velocity):
    assume(np.hypot(*(place - TARGET)[:2]) > 0.5 and np.hypot(*(other - TARGET)[:2]) > 0.5)
    seen = scene(place, obstacles([other]), gradient, target_velocity=velocity)
    by = angle(turned(seen), seen.destination, seen.target_end)
    size = np.linalg.norm(gradient)
    expected = min(CONFIG.k_s * size, np.pi / 2) if size >= CONFIG.arrived else 0.0
    assert abs(by) == pytest.approx(expected, abs=1e-6) or by == pytest.approx(0.0, abs=1e-9)


@LAWS
@given(place=vectors(12.0), other=vectors(12.0), gradient=vectors(20.0), surface=SURFACES)
def test_the_destination_stays_on_its_surface(place, other, gradient, surface):
    seen = scene(place, obstacles([other]), gradient, surface=surface)
    there = turned(seen) - TARGET
    if surface is None:
        assert np.linalg.norm(there) == pytest.approx(np.linalg.norm(seen.destination - TARGET), abs=1e-9)
    else:
        np.testing.assert_allclose(surface.nearest(there), there, atol=1e-5)


@LAWS
@given(place=vectors(12.0), other=vectors(12.0), surface=SURFACES, size=numbers(0.0, 1.0))
def test_nothing_is_left_of_it_on_the_surface(place, other, surface, size):
    """Where the gradient vanishes the swivel vanishes."""
    gradient = np.array([size * CONFIG.arrived * 0.999, 0.0, 0.0])
    seen = scene(place, obstacles([other]), gradient, surface=surface)
    assert turned(seen) is seen.destination


@LAWS
@given(place=vectors(12.0), others=st.lists(vectors(12.0), min_size=1, max_size=4), gradient=vectors(20.0))
def test_the_mirror_image_swivels_as_the_mirror_image(place, others, gradient):
    """The paper's sign of ψ has this mirror only; away from the others has every one."""
    bearings = [angle(place, other, TARGET) for other in others]
    assume(min(abs(b) for b in bearings) > 1e-6 and max(abs(b) for b in bearings) < np.pi - 1e-6)
    for M in (MIRROR, np.diag([-1.0, 1.0, 1.0])):
        seen = turned(scene(place, obstacles(others), gradient))
        mirrored = scene(M @ place, obstacles(np.array(others) @ M), M @ gradient, target=M @ TARGET)
        np.testing.assert_allclose(turned(mirrored), M @ seen, atol=1e-9)


def test_two_abreast_turn_apart():
    left, right = np.array([-8.0, 0.5, 5.0]), np.array([-8.0, -0.5, 5.0])
    strong = np.array([20.0, 0.0, 0.0])
    of_left = turned(scene(left, obstacles([right]), strong))
    of_right = turned(scene(right, obstacles([left]), strong))
    assert of_left[1] > 1.0
    assert of_right[1] < -1.0


def test_alone_there_is_no_reason_to_turn():
    seen = scene(np.array([-8.0, 0.5, 5.0]), obstacles([]), np.array([20.0, 0.0, 0.0]))
    assert turned(seen) is seen.destination


def test_the_sense_is_kept_until_the_arrival():
    """The other changes sides on the way; who turned left goes on to turn left."""
    method, own = Swivel(CONFIG, "own"), np.array([-8.0, 0.0, 5.0])
    strong, none = np.array([20.0, 0.0, 0.0]), np.array([0.1, 0.0, 0.0])
    right, left = obstacles([[-8.0, -1.0, 5.0]]), obstacles([[-8.0, 1.0, 5.0]])
    first = turned(scene(own, right, strong), method)
    np.testing.assert_array_equal(turned(scene(own, left, strong), method), first)
    turned(scene(own, left, none), method)
    after = turned(scene(own, left, strong), method)
    np.testing.assert_allclose(after, MIRROR @ first, atol=1e-9)
