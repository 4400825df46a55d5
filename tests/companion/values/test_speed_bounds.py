"""What a plan keeps of the bounds on its speed."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.values.speed_bounds import REACTION_S, Slowing, SpeedBounds, allowed
from tests.companion.rig import LAWS, QUICK, ZERO, numbers, vectors

UNIT = vectors(1.0).filter(lambda one: np.linalg.norm(one) > 0.1).map(lambda one: one / np.linalg.norm(one))
DT, STEPS, A_TOTAL, BRAKING, TIME = 0.1, 16, 7.0, 2.0, 1.0
PLACES = st.lists(st.tuples(UNIT, numbers(0.0, 12.0)), min_size=1, max_size=7)
PUSHES = st.lists(vectors(4.0), min_size=STEPS, max_size=STEPS)


def bounds_of(places, floor=0.0, leaving=0.0):
    normals, gaps = (np.array(part) for part in zip(*places, strict=True))
    floors, leaving = np.full(len(gaps), floor), np.full(len(gaps), leaving)
    return SpeedBounds(ZERO, normals, gaps, floors, leaving, BRAKING, TIME)


def flown(velocity, a):
    """Positions and velocities (STEPS + 1, 3) of a plan from the origin on."""
    places, speeds = [np.zeros(3)], [np.array(velocity)]
    for one in a:
        places.append(places[-1] + DT * speeds[-1] + 0.5 * DT * DT * one)
        speeds.append(speeds[-1] + DT * one)
    return np.array(places), np.array(speeds)


def slowed(velocity, a, bounds, j_max=None, elapsed=inf):
    a = np.array(a)
    Slowing(DT, A_TOTAL, j_max).keep(ZERO, np.array(velocity), ZERO, elapsed, bounds, a)
    return a


@given(gap=numbers(0.0, 50.0), other=numbers(0.0, 50.0))
def test_two_that_keep_the_speed_decelerate_as_they_can_and_never_close_the_gap(gap, other):
    low, high = sorted((gap, other))
    slow, fast = allowed(np.array([low, high]), BRAKING, TIME)
    assert slow <= fast
    # dw/dt = −2 w dw/dg = −d(w²)/dg where both come nearer at w.
    assert fast**2 - slow**2 <= BRAKING * (high - low) + 1e-9
    assert fast <= high / TIME + 1e-12


@LAWS
@given(places=PLACES, pushes=PUSHES)
def test_a_plan_from_rest_keeps_its_bounds_at_every_step(places, pushes):
    bounds = bounds_of(places)
    x, v = flown(ZERO, slowed(ZERO, pushes, bounds))
    reach = BRAKING * REACTION_S
    for place, velocity in zip(x[:-1], v[1:], strict=True):
        gaps = np.maximum(bounds.gaps - bounds.normals @ place, 0.0)
        stopping = np.sqrt(reach**2 + 2.0 * BRAKING * gaps) - reach
        assert np.linalg.norm(velocity) <= allowed(gaps, BRAKING, TIME).min() + 1e-6
        assert (bounds.normals @ velocity <= stopping + 1e-6).all()
    assert (bounds.normals @ x.T <= bounds.gaps[:, None] + 1e-6).all()


@LAWS
@given(places=PLACES, velocity=vectors(5.0), pushes=PUSHES)
def test_who_is_too_fast_becomes_no_faster_with_no_more_than_it_has(places, velocity, pushes):
    bounds = bounds_of(places)
    a = slowed(velocity, pushes, bounds)
    assert (np.linalg.norm(a, axis=1) <= A_TOTAL + 1e-9).all()
    x, v = flown(velocity, a)
    for place, before, after in zip(x[:-1], v[:-1], v[1:], strict=True):
        gaps = np.maximum(bounds.gaps - bounds.normals @ place, 0.0)
        fastest = allowed(gaps, BRAKING, TIME).min()
        assert np.linalg.norm(after) <= max(np.linalg.norm(before), fastest) + 1e-9


def test_who_has_no_room_left_brakes_with_all_that_it_has():
    bounds = bounds_of([(np.array([1.0, 0.0, 0.0]), 0.0)])
    a = slowed([4.0, 0.0, 0.0], np.zeros((STEPS, 3)), bounds)
    _, v = flown([4.0, 0.0, 0.0], a)
    expected = np.maximum(4.0 - DT * A_TOTAL * np.arange(STEPS + 1), 0.0)
    np.testing.assert_allclose(v[:, 0], expected, atol=1e-9)


@LAWS
@given(places=PLACES, pushes=PUSHES)
def test_flights_at_one_height_stay_at_it(places, pushes):
    bounds = bounds_of(places)
    bounds = bounds._replace(normals=bounds.normals * np.array([1.0, 1.0, 0.0]))
    x, v = flown(ZERO, slowed(ZERO, np.array(pushes) * np.array([1.0, 1.0, 0.0]), bounds))
    assert not v[:, 2].any()
    assert (bounds.normals @ x.T <= bounds.gaps[:, None] + 1e-6).all()


@QUICK
@given(velocity=vectors(0.2), pushes=st.lists(vectors(0.1), min_size=STEPS, max_size=STEPS))
def test_a_plan_within_its_bounds_is_left_alone(velocity, pushes):
    bounds = bounds_of([(np.array([1.0, 0.0, 0.0]), 40.0)])
    np.testing.assert_allclose(slowed(velocity, pushes, bounds), np.array(pushes), atol=1e-9)


@QUICK
@given(places=PLACES, velocity=vectors(2.0), pushes=PUSHES, elapsed=st.sampled_from([0.02, 0.1, inf]))
def test_bounded_jerk_comes_first(places, velocity, pushes, elapsed):
    a = slowed(velocity, pushes, bounds_of(places), (3.5, 3.5, 2.0), elapsed)
    most = np.array([3.5, 3.5, 2.0]) * DT
    assert (np.abs(a[0]) <= most * min(elapsed, DT) / DT + 1e-9).all()
    assert (np.abs(np.diff(a, axis=0)) <= most + 1e-9).all()


@LAWS
@given(places=PLACES, towards=UNIT, floor=numbers(0.0, 1.0), leaving=numbers(0.0, 1.0))
def test_the_speed_in_a_direction_is_that_of_a_plan_that_wants_more(places, towards, floor, leaving):
    """Away from all places, so that the gaps do not shrink on the way: the aim and the plan agree."""
    bounds = bounds_of(places, floor, leaving)
    ahead = bounds.normals @ towards > 0.0
    bounds = bounds._replace(normals=np.where(ahead[:, None], -bounds.normals, bounds.normals))
    speed = bounds.along(towards)
    a = slowed(speed * towards, np.tile(3.0 * towards, (STEPS, 1)), bounds)
    _, v = flown(speed * towards, a)
    np.testing.assert_allclose(v[1], speed * towards, atol=1e-9)


def test_without_a_direction_or_a_place_nothing_is_bounded():
    bounds = bounds_of([(np.array([1.0, 0.0, 0.0]), 3.0)])
    assert bounds.along(ZERO) == inf
    empty = np.zeros(0)
    none = bounds._replace(normals=np.zeros((0, 3)), gaps=empty, floors=empty, leaving=empty)
    assert none.along(np.array([1.0, 0.0, 0.0])) == inf


@pytest.mark.parametrize("floor", [0.0, 1.0])
def test_beside_one_that_is_gone_a_vehicle_leaves_at_the_floor_and_comes_no_nearer(floor):
    bounds = bounds_of([(np.array([1.0, 0.0, 0.0]), 0.0)], floor)
    assert bounds.along(np.array([1.0, 0.0, 0.0])) == 0.0
    assert bounds.along(np.array([0.0, 1.0, 0.0])) == pytest.approx(floor)
    assert bounds.along(np.array([-1.0, 0.0, 0.0])) == pytest.approx(floor)


@LAWS
@given(places=PLACES, wish=UNIT, leaving=numbers(0.1, 1.0))
def test_a_vehicle_without_a_gap_leaves_all_places_or_stays(places, wish, leaving):
    """The aim and the plan agree on it: away at the small speed, and never towards a place."""
    normals = np.array([one for one, _ in places])
    bounds = bounds_of([(one, 0.0) for one in normals], leaving=leaving)
    speed = bounds.along(wish)
    assert speed == pytest.approx(0.0 if (normals @ wish > 1e-9).any() else leaving)
    x, v = flown(ZERO, slowed(ZERO, np.tile(3.0 * wish / DT, (STEPS, 1)), bounds))
    assert (normals @ v[1] <= 1e-6).all()
    assert (normals @ x.T <= 1e-6).all()
    assert np.linalg.norm(v[1]) <= leaving + 1e-9
    if speed:
        np.testing.assert_allclose(v[1], np.minimum(leaving, A_TOTAL * DT) * wish, atol=1e-6)


def test_beside_a_place_that_is_left_the_others_bounds_hold():
    east, north = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    bounds = bounds_of([(east, 0.0), (north, 0.2)])._replace(leaving=np.array([1.0, 0.0]))
    assert bounds.along(-east) == pytest.approx(0.2)
    assert bounds.along(east) == 0.0
