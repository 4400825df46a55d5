"""The tangential band: where it acts, which way, how strongly, and what it remembers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from companion.avoidance.field.methods import Influence
from companion.config.planning import TangentialConfig
from tests.companion.band import NOTHING, force, method, scene
from tests.companion.rig import LAWS, ZERO, numbers, obstacles, vectors

D_SAFE = 3.0
CONFIG = TangentialConfig()
EDGE = D_SAFE + CONFIG.d_band
assert CONFIG.wrong_side is not None
WHOLE, ZERO_FROM = CONFIG.wrong_side
SENSES = st.sampled_from(["own", "right", "left"])
MIRROR = np.diag([1.0, -1.0, 1.0])


@LAWS
@given(place=vectors(4.0), velocity=vectors(5.0), own=vectors(5.0), gradient=vectors(20.0), sense=SENSES)
def test_one_obstacle_is_passed_sideways_and_level(place, velocity, own, gradient, sense):
    others = obstacles([place], [velocity])
    f, scale = force(others, velocity=own, gradient=gradient, sense=sense)
    size = np.linalg.norm(f)
    assert f[2] == 0.0
    assert f[:2] @ place[:2] == pytest.approx(0.0, abs=1e-9)
    assert size <= min(CONFIG.k_tang * np.linalg.norm(gradient), CONFIG.force_max) + 1e-9
    assert scale in (1.0, CONFIG.omega_scale)
    if size > 0.0:
        assert scale == CONFIG.omega_scale


def test_close_ahead_it_is_at_its_full():
    f, scale = force(obstacles([[1.0, 0.1, 0.0]]))
    assert np.linalg.norm(f) == pytest.approx(CONFIG.force_max, rel=0.01)
    assert scale == CONFIG.omega_scale


def test_it_is_the_papers_gain_times_the_gradient_where_that_is_less():
    for size in (0.1, 0.5, 1.0):
        f, _ = force(obstacles([[1.0, 0.1, 0.0]]), gradient=[0.0, 0.0, size])
        assert np.linalg.norm(f) == pytest.approx(CONFIG.k_tang * size)


@LAWS
@given(direction=vectors(1.0).filter(lambda d: d[0] > 0.2), beyond=numbers(1e-6, 50.0), sense=SENSES)
def test_it_is_zero_outside_the_band(direction, beyond, sense):
    place = direction / np.linalg.norm(direction) * (EDGE + beyond)
    given_in = method(sense).influence(scene(obstacles([place])), NOTHING)
    assert given_in is NOTHING


@LAWS
@given(angle=numbers(-1.0, 1.0), inside=numbers(1e-6, 1e-4), sense=SENSES)
def test_it_begins_at_zero_at_the_edge_of_the_band(angle, inside, sense):
    place = (EDGE - inside) * np.array([np.cos(angle), np.sin(angle), 0.0])
    f, _ = force(obstacles([place]), sense=sense)
    assert np.linalg.norm(f) < 0.01


@LAWS
@given(closing=numbers(2.5, 8.0), offset=numbers(-0.5, 0.5))
def test_what_comes_fast_is_met_further_out(closing, offset):
    """The band reaches further by ``reach_s`` times the closing speed, whoever moves."""
    distance = EDGE + 0.5 * CONFIG.reach_s * closing
    place = [np.sqrt(distance**2 - offset**2), offset, 0.0]
    towards = closing * np.array(place) / distance
    assert np.linalg.norm(force(obstacles([place]), velocity=towards)[0]) > 0.0
    np.testing.assert_allclose(
        force(obstacles([place], [-towards]))[0], force(obstacles([place]), velocity=towards)[0], atol=1e-6
    )
    assert not force(obstacles([place]), velocity=-towards)[0].any()


@LAWS
@given(
    angle=st.one_of(numbers(np.pi / 2 + 1e-6, np.pi), numbers(-np.pi, -np.pi / 2 - 1e-6)),
    distance=numbers(0.5, 3.9),
    height=numbers(-1.0, 1.0),
    sense=SENSES,
)
def test_what_is_abeam_or_behind_is_passed(angle, distance, height, sense):
    place = distance * np.array([np.cos(angle), np.sin(angle), height])
    assert method(sense).influence(scene(obstacles([place])), NOTHING) is NOTHING


@LAWS
@given(distance=numbers(0.1, 3.0), sense=SENSES)
def test_what_lies_well_beyond_the_destination_is_in_nobodys_way(distance, sense):
    length = 0.9
    others = obstacles([[length + D_SAFE + 1e-6, 0.0, 0.0]])
    assert method(sense).influence(scene(others, to_go=(length, 0.0, 0.0)), NOTHING) is NOTHING


@LAWS
@given(place=vectors(4.0), sense=SENSES)
def test_at_the_destination_it_is_zero(place, sense):
    f, _ = force(obstacles([place]), to_go=ZERO, gradient=ZERO, sense=sense)
    assert not f.any()
    f, _ = force(obstacles([place]), gradient=ZERO, sense=sense)
    assert not f.any()


@LAWS
@given(distance=numbers(0.5, 3.9), sine=numbers(-WHOLE, WHOLE), velocity=vectors(5.0))
def test_right_and_left_are_opposite_for_what_is_ahead(distance, sine, velocity):
    others = obstacles([[distance * np.sqrt(1.0 - sine**2), distance * sine, 0.0]], [velocity])
    right, left = (force(others, sense=sense)[0] for sense in ("right", "left"))
    np.testing.assert_allclose(right, -left, atol=1e-9)


@LAWS
@given(places=st.lists(vectors(4.0), min_size=1, max_size=4), own=vectors(5.0), sense=SENSES)
def test_the_force_about_an_obstacle_leads_back_no_further_than_its_bearing_allows(places, own, sense):
    """Of a vehicle that has an obstacle on the wrong side of its course: it would be thrown out of a ring."""
    for place in places:
        f, _ = force(obstacles([place]), velocity=own, sense=sense)
        # The course is east.
        assert f[0] >= -ZERO_FROM * np.linalg.norm(f) - 1e-9


@pytest.mark.parametrize(("sense", "side"), [("right", -1.0), ("left", 1.0)])
def test_an_obstacle_well_on_the_other_side_is_passed_there(sense, side):
    angle = side * (np.arcsin(ZERO_FROM) + 0.01)
    place = 2.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
    assert method(sense).influence(scene(obstacles([place])), NOTHING) is NOTHING


@LAWS
@given(place=vectors(4.0), velocity=vectors(5.0))
def test_without_a_wrong_side_right_and_left_are_opposite_everywhere(place, velocity):
    there = scene(obstacles([place], [velocity]))
    right, left = (
        method(sense, wrong_side=None).influence(there, NOTHING).force for sense in ("right", "left")
    )
    np.testing.assert_array_equal(right, -left)


def test_a_wrong_side_whose_force_ends_before_it_begins_to_fade_is_refused():
    with pytest.raises(ValidationError, match="the first must be less"):
        TangentialConfig(wrong_side=(0.8, 0.4))


def test_passing_right_leaves_the_obstacle_on_the_left():
    # Course east, obstacle ahead: to the right is south.
    assert force(obstacles([[2.0, 0.0, 0.0]]), sense="right")[0][1] < 0.0
    assert force(obstacles([[2.0, 0.0, 0.0]]), sense="left")[0][1] > 0.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_its_own_sense_is_the_shorter_way_round(side):
    f, _ = force(obstacles([[2.0, side * 0.3, 0.0]]))
    assert f[1] * side < 0.0


@LAWS
@given(
    places=st.lists(vectors(4.0), min_size=1, max_size=4),
    own=vectors(5.0),
    to_go=vectors(10.0).filter(lambda d: float(d @ d) > 1.0),
    sense=SENSES,
)
def test_a_mirrored_scene_mirrors_the_force(places, own, to_go, sense):
    for place in places:
        # Straight ahead neither side is the shorter: either will do.
        assume(abs(to_go[0] * place[1] - to_go[1] * place[0]) > 1e-6)
    f, scale = force(obstacles(places), to_go, velocity=own, sense=sense)
    mirrored = {"own": "own", "right": "left", "left": "right"}[sense]
    g, same = force(obstacles(places @ MIRROR), to_go @ MIRROR, velocity=own @ MIRROR, sense=mirrored)
    np.testing.assert_allclose(g, f @ MIRROR, atol=1e-6)
    assert scale == same


@LAWS
@given(
    places=st.lists(vectors(4.0), min_size=1, max_size=4),
    own=vectors(5.0),
    to_go=vectors(10.0).filter(lambda d: float(d @ d) > 1.0),
    turn=numbers(-np.pi, np.pi),
    sense=SENSES,
)
def test_turning_the_scene_about_the_vertical_turns_the_force(places, own, to_go, turn, sense):
    for place in places:
        assume(abs(to_go[0] * place[1] - to_go[1] * place[0]) > 1e-6)
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    f, scale = force(obstacles(places), to_go, velocity=own, sense=sense)
    g, same = force(obstacles(places @ R.T), R @ to_go, velocity=R @ own, sense=sense)
    # Where a sum of forces all but cancels, its direction is rounding.
    assume(np.linalg.norm(f) > 1e-3 or not f.any())
    np.testing.assert_allclose(g, R @ f, atol=1e-5)
    assert scale == same


@LAWS
@given(places=st.lists(vectors(4.0), min_size=2, max_size=6), sense=SENSES)
def test_many_obstacles_never_ask_for_more_than_one_may(places, sense):
    f, _ = force(obstacles(places), sense=sense)
    assert np.linalg.norm(f) <= CONFIG.force_max + 1e-9
    assert f[2] == 0.0


def test_the_sense_is_kept_while_an_encounter_lasts():
    band = method()
    first = band.influence(scene(obstacles([[2.5, 0.2, 0.0]])), NOTHING).force[0]
    # The bearing crosses zero: without a latch the force would change sides.
    second = band.influence(scene(obstacles([[2.0, -0.2, 0.0]])), NOTHING).force[0]
    assert first[1] < 0.0
    assert second[1] < 0.0
    assert force(obstacles([[2.0, -0.2, 0.0]]))[0][1] > 0.0


@pytest.mark.parametrize(
    "gone",
    [
        obstacles([[EDGE + 1.0, 0.0, 0.0]]),
        obstacles([[-2.0, 0.0, 0.0]]),
        obstacles([]),
        obstacles([[2.0, 0.2, 0.0]])._replace(ids=(9,)),
    ],
    ids=["out of the band", "behind", "nobody left", "another"],
)
def test_the_sense_is_forgotten_when_the_encounter_ends(gone):
    band = method()
    band.influence(scene(obstacles([[2.5, 0.2, 0.0]])), NOTHING)
    band.influence(scene(gone), NOTHING)
    again = band.influence(scene(obstacles([[2.0, -0.2, 0.0]])), NOTHING).force[0]
    assert again[1] > 0.0


def test_senses_belong_to_obstacles_not_to_rows():
    band = method()
    one = obstacles([[2.5, 0.2, 0.0]])
    band.influence(scene(one), NOTHING)
    both = obstacles([[2.0, 8.0, 0.0], [2.0, -0.2, 0.0]])._replace(ids=(5, 1))
    assert band.influence(scene(both), NOTHING).force[0][1] < 0.0


def test_the_fields_force_is_kept():
    field = Influence(np.arange(48.0).reshape(16, 3), 1.0, ZERO)
    others = obstacles([[2.0, 0.2, 0.0]])
    alone = method().influence(scene(others), NOTHING).force
    np.testing.assert_allclose(method().influence(scene(others), field).force, field.force + alone)


@pytest.mark.parametrize("place", [ZERO, [0.0, 0.0, 1.0], [0.0, 0.0, -2.0], [1e-9, 0.0, 0.0]])
def test_an_obstacle_in_the_same_place_or_above_gives_a_finite_force(place):
    f, _ = force(obstacles([place]), velocity=np.array([1.0, 0.0, 0.0]))
    assert np.isfinite(f).all()
    assert np.linalg.norm(f) <= CONFIG.force_max + 1e-9


@LAWS
@given(aside=numbers(D_SAFE + 0.1, 3.9), speed=numbers(1.0, 5.0))
def test_who_is_passed_by_far_is_not_passed_around(aside, speed):
    """In the band and ahead, but its course leads past by more than d_safe."""
    place = [2.0, aside, 0.0]
    assert not force(obstacles([place]), velocity=np.array([speed, 0.0, 0.0]))[0].any()


def test_who_is_fast_sideways_is_not_made_faster():
    """From rest the force is whole; at ``pass_speed`` along it there is none."""
    ahead = obstacles([[1.5, 0.05, 0.0]])
    still = force(ahead)[0]
    sideways = still / np.linalg.norm(still)
    half, whole = (force(ahead, velocity=share * CONFIG.pass_speed * sideways)[0] for share in (0.5, 1.0))
    assert np.linalg.norm(half) > 0.0
    assert not whole.any()
