"""Laws of the stand-off: the target is inside the field of view with its margin, or as far as allowed."""

from __future__ import annotations

from math import atan2, degrees, hypot, radians, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.formation import FieldOfView
from companion.goals.field_of_view import in_view

PLACES = st.tuples(st.floats(1.0, 20.0), st.floats(-3.1, 3.1), st.floats(1.0, 15.0))


def place(across: float, bearing: float, up: float) -> np.ndarray:
    return np.array([across * np.cos(bearing), across * np.sin(bearing), up])


@given(PLACES, st.floats(0.0, 3.0), st.one_of(st.none(), st.floats(10.0, 80.0)))
def test_the_margin_is_inside_or_the_camera_is_as_far_as_allowed(polar, sigma, pitch):
    view = FieldOfView(pitch_deg=pitch, farthest=2.0)
    before = place(*polar)
    found = in_view(view, before, sigma)
    assert atan2(found[1], found[0]) == pytest.approx(atan2(before[1], before[0]))
    distance, longest = np.linalg.norm(found), 2.0 * np.linalg.norm(before)
    assert distance <= longest * (1.0 + 1e-9)
    elevation = degrees(atan2(found[2], hypot(found[0], found[1])))
    off = 0.0 if pitch is None else abs(elevation - pitch)
    half = min(0.5 * view.height_deg - off, 0.5 * view.width_deg)
    room = distance * tan(radians(max(half, 0.0)))
    inside = off <= 0.5 * view.height_deg + 1e-6 and 2.0 * sigma <= room + 1e-6
    assert inside or distance == pytest.approx(longest)


@given(PLACES)
def test_a_target_well_inside_moves_nothing(polar):
    before = place(*polar)
    elevation = degrees(atan2(before[2], hypot(before[0], before[1])))
    if elevation < 89.0:
        view = FieldOfView(pitch_deg=min(elevation, 89.0))
        np.testing.assert_allclose(in_view(view, before, 0.01), before, atol=1e-9)


def test_the_margin_grows_with_the_covariance():
    view = FieldOfView(farthest=10.0)
    far = [float(np.linalg.norm(in_view(view, place(4.0, 0.3, 5.0), sigma))) for sigma in (0.5, 2.0, 4.0)]
    assert far == sorted(far)
    assert far[2] > far[1] > hypot(4.0, 5.0)


@pytest.mark.parametrize("offset", [(0.0, 0.0, 5.0), (4.0, 0.0, 0.0), (4.0, 0.0, -3.0)])
def test_straight_above_and_level_with_the_target_it_stays(offset):
    before = np.array(offset)
    np.testing.assert_array_equal(in_view(FieldOfView(pitch_deg=30.0), before, 0.5), before)
