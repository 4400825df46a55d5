"""Laws of the pinhole: extents and places are inverses, and the covariance is that of the errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mavlink_bridge.pinhole import (
    Extent,
    Pinhole,
    conjugate,
    covariance,
    extent,
    foot,
    matrix,
    product,
    rotated,
    upward,
)
from sitl.values.attitudes import quaternion

CAMERA = Pinhole.of_field(1280, 720, math.radians(70.0))
roll, pitch = st.floats(-0.6, 0.6), st.floats(-1.2, 1.2)
attitudes = st.builds(quaternion, roll, pitch, st.floats(-math.pi, math.pi))
heights = st.floats(0.2, 3.0)
feet = st.tuples(st.floats(4.0, 60.0), st.floats(-20.0, 20.0), st.floats(-15.0, 15.0))


def shown(place: tuple[float, float, float], up: tuple[float, float, float], height: float) -> Extent:
    assume(place[0] + height * up[0] > 0.5)
    seen = extent(CAMERA, place, up, height)
    assume(seen.foot - seen.top > 4.0)
    return seen


@given(feet, attitudes, heights)
def test_a_place_is_found_again_from_its_extent_in_the_image(place, attitude, height) -> None:
    up = upward(attitude)
    seen = shown(place, up, height)
    assert foot(CAMERA, seen, up, height) == pytest.approx(place, rel=1e-9, abs=1e-9)


@given(feet, attitudes, heights, st.floats(0.5, 2.0))
def test_a_place_is_proportional_to_the_height_that_is_assumed(place, attitude, height, factor) -> None:
    up = upward(attitude)
    seen = shown(place, up, height)
    far = foot(CAMERA, seen, up, factor * height)
    assert far == pytest.approx(tuple(factor * part for part in place), rel=1e-9, abs=1e-9)


@given(feet, attitudes, heights)
def test_the_covariance_has_the_slopes_of_finite_differences(place, attitude, height) -> None:
    up = upward(attitude)
    seen = shown(place, up, height)
    step = 1e-4
    columns = []
    for one in range(3):
        sides = [seen._replace(**{seen._fields[one]: seen[one] + sign * step}) for sign in (1, -1)]
        after, before = (np.array(foot(CAMERA, side, up, height)) for side in sides)
        columns.append((after - before) / (2 * step))
    slopes = np.stack(columns, axis=1)
    along = np.array(place) / height
    expected = 4.0 * slopes @ slopes.T + 0.01 * np.outer(along, along)
    found = covariance(CAMERA, seen, up, height, 2.0, 0.1)
    assert found == pytest.approx(expected, rel=1e-4, abs=1e-6 * np.abs(expected).max())


@given(attitudes, st.tuples(*[st.floats(-50, 50)] * 3))
def test_rotations_keep_lengths_and_are_undone_by_their_conjugates(attitude, vector) -> None:
    turned = rotated(attitude, vector)
    assert math.hypot(*turned) == pytest.approx(math.hypot(*vector), rel=1e-12, abs=1e-12)
    assert rotated(conjugate(attitude), turned) == pytest.approx(vector, abs=1e-12)
    assert matrix(attitude) @ np.array(vector) == pytest.approx(np.array(turned), abs=1e-12)


@given(attitudes, attitudes)
def test_products_apply_the_second_rotation_first(first, second) -> None:
    vector = (1.0, -2.0, 0.5)
    assert rotated(product(first, second), vector) == pytest.approx(
        rotated(first, rotated(second, vector)), abs=1e-12
    )
    assert rotated(first, upward(first)) == pytest.approx((0.0, 0.0, -1.0), abs=1e-12)


def test_the_field_of_view_ends_at_the_edges_of_the_image() -> None:
    across, down = CAMERA.fields
    assert math.degrees(across) == pytest.approx(70.0)
    edge = CAMERA.pixel((1.0, math.tan(0.5 * across), math.tan(0.5 * down)))
    assert edge == pytest.approx((1280.0, 720.0))


def test_an_extent_without_height_or_upside_down_has_no_place() -> None:
    level = upward((1.0, 0.0, 0.0, 0.0))
    for seen in (Extent(640.0, 300.0, 300.0), Extent(640.0, 400.0, 300.0)):
        assert foot(CAMERA, seen, level, 1.8) is None
        with pytest.raises(ValueError, match="no object"):
            covariance(CAMERA, seen, level, 1.8, 1.0, 0.1)
