"""Fields of view and rays in pictures: they are what cameras say, by the pinhole's own projection."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.frames import FleetFrame, enu_to_ned
from mavlink_bridge.messages import CameraFovStatus, CameraTrackingGeo, Heartbeat, Source
from mavlink_bridge.pinhole import Pinhole, conjugate, rotated
from outrider.scene.camera_view import COLUMNS, NO_VIEW, CameraReceiver, field_lines, rays, view_row
from sitl.values.attitudes import quaternion

CAMERA = Pinhole.of_field(1280, 720, math.radians(70.0))
SITE = FleetFrame(47.4, 8.5, 500.0)
ME = Source(11, 100)
places = st.tuples(*[st.floats(-50.0, 50.0)] * 3)


@given(places, st.floats(-0.5, 0.5), st.floats(-1.4, 0.5), st.floats(-3.1, 3.1), st.floats(0.5, 20.0))
def test_the_corners_of_a_field_are_those_of_the_image(place, roll, pitch, yaw, depth) -> None:
    attitude = quaternion(roll, pitch, yaw)
    (lines,) = field_lines(view_row(place, attitude, CAMERA.fields, None)[None], depth).astype(float)
    np.testing.assert_allclose(lines[:4, 0], np.tile(place, (4, 1)), atol=1e-4)
    pixels = []
    for end in lines[:4, 1]:
        north, east, down = enu_to_ned(end - np.array(place))
        point = rotated(conjugate(attitude), (north, east, down))
        assert point[0] == pytest.approx(depth, rel=1e-3, abs=1e-3)
        pixels.append(CAMERA.pixel(point))
    expected = [(0.0, 0.0), (1280.0, 0.0), (1280.0, 720.0), (0.0, 720.0)]
    np.testing.assert_allclose(pixels, expected, atol=0.5 + 0.1 / depth)
    # The other four lines are the rectangle of these ends.
    np.testing.assert_array_equal(lines[4:, 0], lines[:4, 1])
    np.testing.assert_array_equal(lines[4:, 1], np.roll(lines[:4, 1], -1, axis=0))


def test_rays_lead_from_the_camera_to_what_it_detects_and_else_nowhere() -> None:
    attitude = (1.0, 0.0, 0.0, 0.0)
    views = np.array(
        [
            view_row((1.0, 2.0, 3.0), attitude, CAMERA.fields, (4.0, 5.0, 0.0)),
            view_row((1.0, 2.0, 3.0), attitude, CAMERA.fields, None),
            view_row(None, None, None, (4.0, 5.0, 0.0)),
            NO_VIEW,
        ]
    )
    lines = rays(views, np.full((4, 3), 7.0, np.float32))
    assert lines[0].tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 0.0]]
    assert lines[2].tolist() == [[7.0, 7.0, 7.0], [4.0, 5.0, 0.0]]
    assert np.isnan(lines[[1, 3], 1]).all()
    assert np.isnan(field_lines(views, 2.0)[2:]).all()


def test_an_image_without_a_detection_ends_the_last_one() -> None:
    camera = CameraReceiver()
    view = CameraFovStatus(ME, 0, SITE.to_geodetic((1.0, 2.0, 3.0)), None, (1.0, 0.0, 0.0, 0.0), 1.2, 0.7)
    geo = CameraTrackingGeo(ME, 1, *SITE.to_geodetic((1.0, 9.0, 0.0)), None)
    assert camera.receive(view, SITE)
    assert np.isnan(camera.row[9:]).all()
    assert camera.receive(geo, SITE)
    np.testing.assert_allclose(camera.row[[0, 1, 2, 9, 10, 11]], (1, 2, 3, 1, 9, 0), atol=1e-3)
    assert camera.receive(view, SITE)
    assert np.isnan(camera.row[9:]).all()
    assert camera.receive(view._replace(attitude=(0.0,) * 4, horizontal_field=0.0), SITE)
    assert np.isfinite(camera.row[:3]).all()
    assert np.isnan(camera.row[3:]).all()
    assert not camera.receive(Heartbeat(ME, 30, 8, 0, 0, 4), SITE)
    assert len(NO_VIEW) == COLUMNS
    assert np.isnan(NO_VIEW).all()
