"""The field of approach angles: around the target, apart, and only between those that may meet."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.avoidance.field.methods import Influence
from companion.avoidance.field.methods.approach_angle import ApproachAngle
from companion.config.planning import ApproachAngleConfig
from tests.companion.rig import LAWS, TARGET, ZERO, numbers, obstacles, scene, vectors

CONFIG = ApproachAngleConfig()
MIRROR = np.diag([1.0, -1.0, 1.0])


def beside(east, north, up):
    """A place (3,) given from the target."""
    return TARGET + np.array([east, north, up])


def force(seen, method=None):
    """F_ang (16, 3)."""
    start = Influence(np.zeros((16, 3)), 1.0, seen.destination)
    influence = (method or ApproachAngle(CONFIG, "own")).influence(seen, start)
    assert influence.destination is seen.destination
    assert influence.omega_scale == 1.0
    return influence.force


@LAWS
@given(
    place=vectors(12.0), others=st.lists(vectors(12.0), max_size=4), v=vectors(4.0), gradient=vectors(20.0)
)
def test_it_acts_level_around_the_target_and_is_bounded(place, others, v, gradient):
    seen = scene(place, obstacles(others), gradient, v)
    f = force(seen)
    along = (seen.prediction - seen.target)[:, :2]
    assert (f[:, 2] == 0.0).all()
    assert np.abs(np.sum(f[:, :2] * along, axis=1)).max() <= 1e-6 * (1.0 + np.abs(along).max())
    assert np.linalg.norm(f, axis=1).max() <= CONFIG.force_max + 1e-9


@LAWS
@given(reach=numbers(4.5, 9.0), offset=numbers(0.01, 0.7), gradient=vectors(20.0))
def test_two_at_nearly_one_angle_are_pushed_apart(reach, offset, gradient):
    """Both at one distance from the target, ``offset`` rad apart."""
    assume(np.linalg.norm(gradient) > 0.1 and offset**2 < 0.9 * CONFIG.d_safe)
    angles = np.pi + np.array([0.5, -0.5]) * offset
    places = [beside(reach * np.cos(a), reach * np.sin(a), 5.0) for a in angles]
    for own, other in (places, places[::-1]):
        f = force(scene(own, obstacles([other]), gradient))[0]
        assert f @ (own - other) > 0.0


@LAWS
@given(place=vectors(12.0), others=st.lists(vectors(12.0), min_size=1, max_size=4), gradient=vectors(20.0))
def test_the_mirror_image_is_pushed_as_the_mirror_image(place, others, gradient):
    bearings = np.array([np.arctan2(*(p - TARGET)[1::-1]) for p in [place, *others]])
    aside = (bearings[0] - bearings[1:] + np.pi) % (2 * np.pi) - np.pi
    assume(np.abs(aside).min() > 1e-6 and np.abs(aside).max() < np.pi - 1e-6)
    f = force(scene(place, obstacles(others), gradient))
    g = force(scene(MIRROR @ place, obstacles(np.array(others) @ MIRROR), MIRROR @ gradient))
    np.testing.assert_allclose(g, f @ MIRROR, atol=1e-6)


@LAWS
@given(place=vectors(12.0), other=vectors(12.0))
def test_without_a_gradient_or_beyond_its_reach_there_is_no_force(place, other):
    assert (force(scene(place, obstacles([other]), ZERO)) == 0.0).all()
    own, across = beside(-10.0, 0.0, 5.0), beside(10.0, 0.0, 5.0)
    assert (force(scene(own, obstacles([across]))) == 0.0).all()


def test_the_seam_of_the_bearings_is_none():
    """π and −π are one direction: a difference of angles is wrapped before it is squared."""
    own, other = beside(-10.0, 0.5, 5.0), beside(-10.0, -0.5, 5.0)
    f = force(scene(own, obstacles([other])))[0]
    assert f[1] > 1.0
    assert f[1] == pytest.approx(-force(scene(other, obstacles([own])))[0][1])


def test_who_is_far_behind_is_in_nobodys_way():
    own = beside(-6.0, 0.2, 5.0)
    assert (force(scene(own, obstacles([beside(-30.0, 0.0, 5.0)]))) == 0.0).all()
    assert (force(scene(own, obstacles([beside(-7.0, 0.0, 5.0)]))) != 0.0).any()


def test_the_sense_is_latched_while_the_encounter_lasts():
    method, own = ApproachAngle(CONFIG, "own"), beside(-10.0, 0.0, 5.0)
    right, left = (obstacles([beside(-10.0, y, 5.0)]) for y in (-0.2, 0.2))
    first = force(scene(own, right), method)[0]
    assert first[1] > 0.0
    assert force(scene(own, left), method)[0][1] > 0.0
    force(scene(own, obstacles([beside(10.0, 0.0, 5.0)])), method)
    assert force(scene(own, left), method)[0][1] < 0.0


def test_who_is_far_off_is_not_met_yet():
    own, near, far = beside(-14.0, 0.2, 5.0), beside(-9.0, 0.0, 5.0), beside(-5.0, 0.0, 5.0)
    assert (force(scene(own, obstacles([near]))) != 0.0).any()
    assert (force(scene(own, obstacles([far]))) == 0.0).all()


def test_who_is_fast_across_is_not_made_faster():
    own, other = beside(-10.0, 0.2, 5.0), obstacles([beside(-10.0, -0.2, 5.0)])
    across = np.sign(force(scene(own, other))[0]) * [0.0, 1.1 * CONFIG.pass_speed, 0.0]
    assert not force(scene(own, other, velocity=across))[0].any()
    assert force(scene(own, other, velocity=-across))[0].any()
