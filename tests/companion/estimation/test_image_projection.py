"""Detections that are places in an image: where the camera looked when it was taken, and what they become."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.telemetry.reception import accepts
from companion.world import World
from mavlink_bridge.messages import Attitude, CameraTrackingImage, GimbalAttitude, Source
from mavlink_bridge.pinhole import Pinhole, conjugate, extent, product, rotated, upward
from mavlink_bridge.wire.codec import Codec
from sitl.values.attitudes import quaternion
from tests.companion.estimation.cameras import START
from tests.companion.estimation.sightings import (
    CAMERA,
    NEIGHBOUR,
    OWN,
    PLACE,
    TARGET,
    give,
    heard,
    started,
    view,
)


def test_a_camera_that_tells_the_place_in_the_image_is_projected():
    of, now = started(height=1.8)
    # North-west of the camera and below it; the camera looks along the ray, level.
    yaw = np.arctan2(PLACE[0] - CAMERA[0], PLACE[1] - CAMERA[1])
    pitch = -0.6
    cy, sy, cp, sp = np.cos(yaw / 2), np.sin(yaw / 2), np.cos(pitch / 2), np.sin(pitch / 2)
    attitude = (cy * cp, -sy * sp, cy * sp, sy * cp)
    camera = Pinhole.of_field(1280, 720, 1.2)
    offset = PLACE - CAMERA
    foot = rotated(conjugate(attitude), (offset[1], offset[0], -offset[2]))
    seen = extent(camera, foot, upward(attitude), 1.8)
    rectangle = ((seen.column - 20) / 1280, seen.top / 720, (seen.column + 20) / 1280, seen.foot / 720)
    looking = view(OWN, 100, now - START - 100_000, CAMERA)._replace(
        attitude=attitude, horizontal_field=camera.fields[0], vertical_field=camera.fields[1]
    )
    said = CameraTrackingImage(Source(OWN, 100), 1, 2, 4, None, None, rectangle)
    give(of, now, "autopilot", (looking, said))
    assert of.target.last(now).position == pytest.approx(PLACE, abs=0.05)
    give(of, now, "autopilot", (looking, said._replace(rectangle=None)))
    assert of.target.counts.invalid == 1


OPTICS = {"width_deg": 70.0, "height_deg": 43.0}


def in_image(attitude, place=PLACE) -> CameraTrackingImage:
    """What a camera at CAMERA with this attitude says of an object of 1.8 m."""
    camera = Pinhole.of_field(
        1000, round(1000 * np.tan(radians(21.5)) / np.tan(radians(35.0))), radians(70.0)
    )
    offset = place - CAMERA
    seen = extent(
        camera, rotated(conjugate(attitude), (offset[1], offset[0], -offset[2])), upward(attitude), 1.8
    )
    assert camera.shows(seen.column, seen.top)
    assert camera.shows(seen.column, seen.foot)
    left, right = (seen.column - 20) / camera.width, (seen.column + 20) / camera.width
    rectangle = (left, seen.top / camera.height, right, seen.foot / camera.height)
    return CameraTrackingImage(Source(OWN, 100), 1, 2, 4, None, None, rectangle)


def turning(of: World, now: int, roll: float) -> None:
    """ATTITUDE 100 ms ago and at ``now``: the vehicle looks west, and rolled from ``roll`` to level since."""
    for age, angle in ((100_000, roll), (0, 0.0)):
        said = Attitude(Source(OWN, 1), now - age - START - 5_000, angle, -0.1, -0.5 * np.pi, (0.0, 0.0, 0.0))
        of.receive(now - age, "autopilot", said)


def test_an_image_without_a_field_of_view_is_projected_by_the_attitude_at_its_time():
    """275 without 271: configured optics, a mount that is fixed to the vehicle, latency as configured."""
    of, now = started(optics={**OPTICS, "pitch_deg": 35.0}, latency_us=100_000)
    now += 200_000
    heard(of, now)
    turning(of, now, roll=0.2)
    body = quaternion(0.2, -0.1, -0.5 * np.pi)
    give(of, now, "autopilot", [in_image(product(body, quaternion(0.0, radians(-35.0), 0.0)))])
    assert of.target.counts.invalid == 0
    assert of.target.age(now) == 100_000
    assert of.target.last(now).position == pytest.approx(PLACE, abs=0.1)
    (out,) = of.forwards(now)
    assert out.time == now - 100_000


@pytest.mark.parametrize("relative", [True, False])
def test_a_gimbal_says_where_a_camera_without_a_field_of_view_looks(relative):
    of, now = started(optics=OPTICS)
    turning(of, now, roll=0.3)
    level = quaternion(0.0, -0.6, 0.0)
    looks = product(quaternion(0.0, 0.0, -0.5 * np.pi), level)
    north = mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME
    said = GimbalAttitude(Source(OWN, 154), now - START - 105_000, 12, level, None)
    if not relative:
        said = said._replace(flags=12 | north, attitude=looks)
    give(of, now, "autopilot", [said, in_image(looks)])
    assert of.target.counts.invalid == 0
    assert of.target.last(now).position == pytest.approx(PLACE, abs=0.1)


LEVEL = quaternion(0.0, -0.6, 0.0)
WEST = product(quaternion(0.0, 0.0, -0.5 * np.pi), LEVEL)
NORTHWARD = 12 | mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME
"""Roll and pitch are relative to the horizon, yaw to north."""


def gimbal(stamp: int, attitude, component: int = 154, flags: int = NORTHWARD) -> GimbalAttitude:
    return GimbalAttitude(Source(OWN, component), stamp, flags, attitude, None)


def test_a_camera_on_a_gimbal_is_never_taken_as_fixed_to_the_vehicle():
    """Of the time of the image only the vehicle's attitude is known: the gimbal's is 0.3 s older."""
    of, now = started(optics={**OPTICS, "pitch_deg": 35.0}, latency_us=100_000)
    give(of, now - 400_000, "autopilot", [gimbal(now - 400_000 - START, WEST)])
    turning(of, now, roll=0.0)
    give(of, now, "autopilot", [in_image(WEST)])
    assert (of.target.counts.invalid, of.target.last(now)) == (1, None)


@pytest.mark.parametrize("ahead", [-1_500_000, -150_000, 150_000, 10**9])
def test_a_gimbal_with_a_boot_clock_of_its_own_is_dated_by_its_arrival(ahead):
    of, now = started(optics=OPTICS, latency_us=100_000)
    for age, attitude in ((200_000, LEVEL), (100_000, WEST), (0, LEVEL)):
        of.receive(now - age, "autopilot", gimbal(now - age - START + ahead, attitude))
    give(of, now, "autopilot", [in_image(WEST)])
    assert of.target.counts.invalid == 0
    assert of.target.last(now).position == pytest.approx(PLACE, abs=0.1)


def test_a_gimbal_of_the_autopilot_is_dated_by_its_stamp():
    of, now = started(optics=OPTICS, latency_us=100_000)
    for age, attitude in ((100_000, LEVEL), (0, WEST)):
        of.receive(now - age, "autopilot", gimbal(now - age - START - 105_000, attitude, component=1))
    give(of, now, "autopilot", [in_image(WEST)])
    assert of.target.counts.invalid == 0
    assert of.target.last(now).position == pytest.approx(PLACE, abs=0.1)


@pytest.mark.parametrize("delta", [0.0, None], ids=["left out", "NaN"])
def test_without_the_difference_of_yaws_a_gimbals_yaw_is_relative_to_the_vehicles_heading(delta):
    """A message without extension fields is decoded with zeros."""
    of, now = started(optics=OPTICS)
    turning(of, now, roll=0.3)
    said, codec = gimbal(now - START, LEVEL, flags=12), Codec()
    (said,) = codec.feed(codec.encode(said._replace(delta_yaw=delta, delta_yaw_rate=delta)))
    give(of, now, "autopilot", [said, in_image(WEST)])
    assert of.target.counts.invalid == 0
    assert of.target.last(now).position == pytest.approx(PLACE, abs=0.1)


def test_the_vehicles_heading_is_that_at_the_gimbals_time():
    """The vehicle looked west 100 ms ago, and looks north since."""
    of, now = started(optics=OPTICS, latency_us=100_000)
    for age, yaw in ((100_000, -0.5 * np.pi), (0, 0.0)):
        said = Attitude(Source(OWN, 1), now - age - START - 5_000, 0.2, -0.1, yaw, (0.0, 0.0, 0.0))
        of.receive(now - age, "autopilot", said)
    said = gimbal(now - START - 105_000, LEVEL, component=1, flags=12)
    give(of, now, "autopilot", [said, in_image(WEST)])
    assert of.target.counts.invalid == 0
    assert of.target.last(now).position == pytest.approx(PLACE, abs=0.1)


def test_a_gimbals_yaw_without_a_heading_of_its_time_is_not_used():
    of, now = started(optics=OPTICS)
    turning(of, now - 500_000, roll=0.0)
    give(of, now, "autopilot", [gimbal(now - START, LEVEL, flags=12), in_image(WEST)])
    assert (of.target.counts.invalid, of.target.last(now)) == (1, None)


def test_an_image_without_a_field_of_view_and_without_optics_is_counted_and_dropped():
    of, now = started()
    turning(of, now, roll=0.0)
    give(of, now, "autopilot", [in_image(quaternion(0.0, -0.6, -0.5 * np.pi))])
    assert (of.target.counts.invalid, of.target.last(now)) == (1, None)


def test_an_attitude_of_another_time_is_not_used():
    of, now = started(optics=OPTICS)
    turning(of, now - 500_000, roll=0.0)
    give(of, now, "autopilot", [in_image(quaternion(0.0, -0.6, -0.5 * np.pi))])
    assert (of.target.counts.invalid, of.target.last(now)) == (1, None)


@pytest.mark.parametrize(
    ("rectangle", "dropped"),
    [((0.4, 0.5, 0.6, 0.5), True), ((0.4, 0.7, 0.6, 0.3), True), ((0.4, 0.3, 0.6, 0.7), False)],
    ids=["flat", "upside down", "a person"],
)
def test_a_rectangle_that_shows_no_object_is_counted_and_dropped(rectangle, dropped):
    of, now = started()
    looking = view(OWN, 100, now - START - 100_000, CAMERA)
    said = CameraTrackingImage(Source(OWN, 100), 1, 2, 4, None, None, rectangle)
    give(of, now, "autopilot", (looking, said))
    assert of.target.counts.invalid == dropped


def test_gimbals_are_received_only_where_they_are_needed():
    gimbal, own = mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS, Source(OWN, 154)
    for optics, expected in ((None, False), (OPTICS, True)):
        config = CompanionConfig.model_validate({"target_source": {"kind": "fused", "optics": optics}})
        assert accepts("autopilot", OWN, TARGET, config)(gimbal, *own) is expected
        assert not accepts("swarm", OWN, TARGET, config)(gimbal, NEIGHBOUR, 154)
