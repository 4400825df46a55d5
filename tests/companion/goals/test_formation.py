"""Laws of the even formation: order, rest, symmetry, and how far outside a vehicle goes round."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.formation import Spread
from companion.goals.formation import even_turn, outside, spacing, taking_part
from companion.values.bearings import turned
from companion.values.obstacles import Obstacles

ANGLES = st.lists(st.floats(0.0, 6.28), min_size=2, max_size=8, unique=True).filter(
    lambda angles: np.diff(np.sort([*angles, min(angles) + 2.0 * np.pi])).min() > 1e-3
)


def offsets(angles):
    return np.stack([5.0 * np.cos(angles), 5.0 * np.sin(angles), np.full(len(angles), 3.0)], axis=1)


def turns(angles):
    places = offsets(np.array(angles))
    return np.array([even_turn(place, np.delete(places, k, axis=0)) for k, place in enumerate(places)])


@given(ANGLES)
def test_all_turns_lead_to_even_bearings_in_the_same_order(angles):
    ends = np.array(angles) + turns(angles)
    order = np.argsort(angles)
    apart = np.diff(np.append(ends[order], ends[order][0] + 2.0 * np.pi))
    np.testing.assert_allclose(apart, 2.0 * np.pi / len(angles), atol=1e-9)


@given(ANGLES)
def test_the_ring_as_a_whole_does_not_turn(angles):
    assert turns(angles).sum() == pytest.approx(0.0, abs=1e-9)


@given(ANGLES, st.floats(-3.0, 3.0))
def test_a_turned_fleet_turns_as_much(angles, by):
    np.testing.assert_allclose(turns(np.array(angles) + by), turns(angles), atol=1e-9)


@given(st.integers(1, 8), st.floats(0.0, 6.28))
def test_an_even_ring_rests(count, first):
    angles = first + 2.0 * np.pi * np.arange(count) / count
    places = offsets(angles)
    assert even_turn(places[0], places[1:]) == pytest.approx(0.0, abs=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_a_vehicle_that_goes_round_does_so_outside(bearing, turn):
    place = turned(np.array([5.0, 0.0, 3.0]), bearing)
    found = outside(place, turn)
    assert found[2] == place[2]
    assert 5.0 - 1e-9 <= np.hypot(*found[:2]) <= 9.0 + 1e-9
    if abs(turn) <= 0.25:
        np.testing.assert_array_equal(found, place)


def test_only_those_near_the_surface_take_part():
    near, far = np.array([12.0, 0.0, 3.0]), np.array([400.0, 0.0, 3.0])
    np.testing.assert_array_equal(taking_part(Spread(kind="spread"), np.stack([near, far]), 5.8), near[None])


def test_one_alone_and_a_point_have_no_places():
    assert spacing(5.0, 0) == spacing(0.0, 4) == np.inf


@given(st.integers(1, 8))
def test_even_places_are_so_far_apart_and_push_no_more_there(others):
    angles = 2.0 * np.pi * np.arange(others + 1) / (others + 1)
    places = offsets(angles)
    apart = np.linalg.norm(places[1:] - places[0], axis=1)
    assert apart.min() == pytest.approx(spacing(5.0, others))
    field = Obstacles(
        tuple(range(others)), places[1:, None], np.full(others, 0.95), np.full(others, 4.85)
    ).shared(frozenset(range(1, others)), spacing(5.0, others))
    assert (apart[1:] >= field.d_safe[1:] - 1e-9).all()
    assert field.d_safe[0] == 4.85
    assert (field.d_safe > field.d_min).all()
