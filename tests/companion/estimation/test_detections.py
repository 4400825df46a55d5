"""Laws of single detections: their covariance is that of the camera, and absurd ones are none."""

from __future__ import annotations

from math import atan2, radians

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from companion.estimation.detections import detection
from companion.estimation.fusion_filter import FIELDS
from mavlink_bridge.pinhole import Pinhole, conjugate, extent, rotated, sighting, upward
from sitl.values.attitudes import quaternion
from tests.companion.estimation.cameras import ACROSS_DEG, ALONG, START, message, source_of, taller


@pytest.mark.parametrize(
    "changes",
    [
        {"horizontal_accuracy": 0.0},
        {"horizontal_accuracy": -1.0},
        {"vertical_accuracy": 1e6},
        {"heading_accuracy": 3.0},
        {"heading_accuracy": 0.0},
    ],
)
def test_absurd_accuracies_are_no_detection(changes):
    camera, place = np.array([6.0, 0.0, 5.0]), np.zeros(3)
    good = message(11, place, camera)
    assert detection(source_of("rtk"), 11, START, place, camera, good) is not None
    assert detection(source_of("rtk"), 11, START, place, camera, good._replace(**changes)) is None
    assert detection(source_of("rtk"), 11, START, place, place, good) is None


@given(st.tuples(*[st.floats(-50.0, 50.0)] * 3), st.tuples(*[st.floats(-20.0, 20.0)] * 3))
@settings(max_examples=60)
def test_a_detection_has_the_covariance_of_its_camera_and_the_directions_of_its_errors(place, offset):
    """R has σ² along the ray, sideways, and up; yaw and elevation move the place to the left and up."""
    camera = np.add(place, offset)
    ray = np.subtract(place, camera)
    distance = float(np.linalg.norm(ray))
    # Nearer ones are at the least σ that is believed.
    assume(distance > 5.0 and np.hypot(ray[0], ray[1]) > 0.01)
    found = detection(source_of("rtk"), 11, START, place, tuple(camera), message(11, np.array(place), camera))
    assert found is not None
    fields, ray = found.fields, ray / distance
    across = radians(ACROSS_DEG) * distance
    along = ALONG * distance
    left, up = fields[12:15], fields[15:18]
    sigmas = along, across, across * taller(np.subtract(place, camera))
    axes = np.array([ray, left / np.linalg.norm(left), up])
    R = axes.T @ np.diag(np.square(sigmas)) @ axes
    np.testing.assert_allclose(fields[3:12].reshape(3, 3), R, rtol=1e-6, atol=1e-9 * distance**2)
    np.testing.assert_allclose(left, np.cross((0.0, 0.0, 1.0), ray), atol=1e-12)
    np.testing.assert_allclose(np.cross(ray, left), np.linalg.norm(left) * up, atol=1e-12)
    np.testing.assert_array_equal(fields[:3], place)
    np.testing.assert_array_equal(fields[18:21], camera)
    assert fields.shape == (FIELDS,)
    assert fields[21] == pytest.approx(distance, rel=1e-14)


@pytest.mark.parametrize("level", [3.0, 6.0, 12.0])
@pytest.mark.parametrize("above", [2.0, 5.0, 8.0])
def test_a_detection_has_the_variances_of_the_camera_along_its_ray_sideways_and_up(level, above):
    """A camera that looks at the foot of a person; 276 does not say the accuracy of the elevation."""
    lens, pitch = Pinhole.of_field(1280, 720, radians(70.0)), atan2(above, level)
    attitude = quaternion(0.0, -pitch, 0.0)
    foot = rotated(conjugate(attitude), (level, 0.0, above))
    seen = extent(lens, foot, upward(attitude), 1.8)
    found = sighting(lens, attitude, seen, 1.8, 8.0, 0.15)
    assert found is not None
    # Looking north: NED and ENU.
    camera, place = np.array([0.0, 0.0, above]), np.array([0.0, level, 0.0])
    said = message(11, place, camera)._replace(
        horizontal_accuracy=found.horizontal_accuracy,
        vertical_accuracy=found.vertical_accuracy,
        heading_accuracy=found.heading_accuracy,
    )
    one = detection(source_of("rtk"), 11, START, tuple(place), tuple(camera), said)
    assert one is not None
    ray = np.array([level, 0.0, above]) / np.hypot(level, above)
    for axis in (ray, np.array([0.0, 1.0, 0.0]), np.array([ray[2], 0.0, -ray[0]])):
        true = axis @ found.errors @ axis
        fleet = np.array([axis[1], axis[0], -axis[2]])
        assert fleet @ one.fields[3:12].reshape(3, 3) @ fleet == pytest.approx(true, rel=0.02)
