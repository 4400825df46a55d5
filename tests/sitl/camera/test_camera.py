"""Laws of the simulated camera: what it says is where the target was, with the errors that it states."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink
from scipy.stats import chi2

from mavlink_bridge.messages import (
    CameraFovStatus,
    CameraInformation,
    CameraTrackingGeo,
    CameraTrackingImage,
    CommandAck,
    GimbalAttitude,
    Heartbeat,
    MessageInterval,
)
from mavlink_bridge.pinhole import Extent, Pinhole, foot, product, rotated, upward
from mavlink_bridge.wire.codec import Codec
from sitl.camera.occlusion import Ball, Column
from sitl.values.attitudes import euler, quaternion
from tests.sitl.camera.rig import OTHER, TICK, Bench

EXACT = {"pixel_sigma": 0.0, "object": {"height_sigma": 0.0}}
DOWN = {"kind": "fixed", "pitch_deg": 30.0}
GIMBAL = {"kind": "gimbal", "pitch_deg": 30.0}


def places(bench: Bench) -> np.ndarray:
    """Detected places (n, 3), m, ENU."""
    found = bench.all(CameraTrackingGeo)
    return np.array([bench.site.to_enu(one.latitude, one.longitude, one.altitude) for one in found])


@pytest.mark.parametrize("mount", [DOWN, GIMBAL])
def test_without_noise_the_target_is_where_it_is(mount) -> None:
    bench = Bench(mount=mount, **EXACT)
    bench.run(4.0)
    found = places(bench)
    assert len(found) > 20
    # degE7 is 1.1 cm; the altitude is a float32.
    assert np.abs(found - np.array(bench.target)).max() < 0.012
    said = bench.all(CameraTrackingGeo)[-1]
    camera = bench.all(CameraFovStatus)[-1]
    eye = bench.site.to_enu(*camera.place)
    offset = np.array(bench.target) - eye
    assert said.distance == pytest.approx(float(np.linalg.norm(offset)), abs=0.02)
    assert said.heading == pytest.approx(math.atan2(offset[0], offset[1]), abs=2e-3)


@pytest.mark.parametrize("mount", [DOWN, GIMBAL])
def test_the_image_alone_leads_to_the_same_place_by_intrinsics_and_attitude(mount) -> None:
    bench = Bench(mount=mount, speaks="image", **EXACT)
    bench.run(4.0)
    assert not bench.all(CameraTrackingGeo)
    # The companion knows the optics from CAMERA_INFORMATION.
    (about,) = (m for m in bench.order(512, 259) if isinstance(m, CameraInformation))
    width, height = about.resolution
    optics = Pinhole(width, height, about.focal_length / about.sensor_size[0] * width)
    said, view = bench.all(CameraTrackingImage)[-1], bench.all(CameraFovStatus)[-1]
    left, top, right, bottom = said.rectangle
    seen = Extent(0.5 * (left + right) * width, top * height, bottom * height)
    place = foot(optics, seen, upward(view.attitude), 1.8)
    north, east, down = rotated(view.attitude, place)
    eye = bench.site.to_enu(*view.place)
    assert eye + np.array((east, north, -down)) == pytest.approx(np.array(bench.target), abs=0.02)


def test_the_errors_have_the_stated_accuracies() -> None:
    """χ² of errors across the ray and along the vertical, and of the horizontal sum, over 1500 images."""
    bench = Bench(mount=DOWN, rate_hz=50.0, object={"height_sigma": 0.1})
    bench.run(32.0)
    errors = places(bench) - np.array(bench.target)
    said = bench.all(CameraTrackingGeo)
    assert len(said) > 1400
    across = np.array([one.heading_accuracy * 8.0 for one in said])
    vertical = np.array([one.vertical_accuracy for one in said])
    level = np.array([one.horizontal_accuracy for one in said])
    n = len(said)
    # The target is north: east is across the ray.
    squares = {
        "across": np.sum((errors[:, 0] / across) ** 2),
        "vertical": np.sum((errors[:, 2] / vertical) ** 2),
        "along": np.sum(errors[:, 1] ** 2 / (level**2 - across**2)),
    }
    low, high = chi2.ppf([0.0005, 0.9995], n)
    assert all(low < square < high for square in squares.values()), (squares, low, high)
    # Images do not depend on each other.
    for k in range(3):
        series = errors[:, k] - errors[:, k].mean()
        correlation = float(series[1:] @ series[:-1] / (series @ series))
        assert abs(correlation) < 4.0 / math.sqrt(n)
        assert abs(errors[:, k].mean()) < 4.0 * errors[:, k].std() / math.sqrt(n) + 0.006


def test_the_error_of_the_range_comes_from_the_height() -> None:
    bench = Bench(mount=DOWN, rate_hz=50.0, pixel_sigma=0.0, object={"height_sigma": 0.18})
    bench.run(20.0)
    eye = bench.site.to_enu(*bench.all(CameraFovStatus)[-1].place)
    offsets = places(bench) - eye
    ranges = np.linalg.norm(offsets, axis=1)
    n, mean = len(ranges), float(np.linalg.norm(np.array(bench.target) - eye))
    square = float(np.sum((ranges / mean - 1.0) ** 2)) / 0.1**2
    assert chi2.ppf(0.0005, n) < square < chi2.ppf(0.9995, n)
    bearings = offsets / ranges[:, None]
    assert np.abs(bearings - bearings.mean(axis=0)).max() < 3e-3


def test_images_come_at_their_rate_and_messages_their_latency_later() -> None:
    bench = Bench(mount=DOWN, rate_hz=12.5, latency_ms=230.0)
    bench.run(4.0)
    views = bench.all(CameraFovStatus)
    stamps = np.array([one.time_boot for one in views])
    assert set(np.diff(stamps)) == {80_000}
    assert bench.times(CameraTrackingGeo) == bench.times(CameraFovStatus)
    assert set(np.array(bench.times(CameraFovStatus)) - stamps) == {230_000}


def test_a_late_message_tells_of_the_image_and_not_of_now() -> None:
    bench = Bench(mount=DOWN, latency_ms=500.0, **EXACT)
    bench.run(2.0)
    moved, bench.target = bench.now, (1.0, 8.0, 0.0)
    bench.run(2.0)
    for view, place in zip(bench.all(CameraFovStatus), places(bench), strict=True):
        expected = 0.0 if view.time_boot < moved - TICK else 1.0
        if abs(view.time_boot - moved) > TICK:
            assert place[0] == pytest.approx(expected, abs=0.02)


def test_messages_of_an_image_are_in_one_datagram_and_in_order() -> None:
    bench = Bench(mount=GIMBAL)
    bench.run(3.0)
    order = [
        type(message)
        for _, message in bench.received
        if isinstance(message, CameraFovStatus | CameraTrackingGeo)
    ]
    assert order == [CameraFovStatus, CameraTrackingGeo] * (len(order) // 2)
    codec = Codec()
    for datagram in bench.datagrams:
        kinds = {type(message) for message in codec.feed(datagram.data)}
        assert (CameraTrackingGeo in kinds) == (CameraFovStatus in kinds)


def test_the_gimbals_attitude_is_told_when_the_image_is_taken() -> None:
    """One dated by its arrival would otherwise be of another time than the image."""
    bench = Bench(mount=GIMBAL, rate_hz=12.5, latency_ms=230.0)
    bench.run(4.0)
    stamps = [one.time_boot for one in bench.all(GimbalAttitude)]
    late = np.array(bench.times(GimbalAttitude)) - stamps
    assert late.min() >= 0
    assert late.max() <= TICK
    images = [one.time_boot for one in bench.all(CameraFovStatus)]
    assert stamps[: len(images)] == images


@pytest.mark.parametrize(
    ("body", "hides"),
    [
        (Column((4.0, 0.0), 0.3, -10.0), True),
        (Column((4.0, 2.0), 0.3, -10.0), False),
        (Column((4.0, 0.0), 0.3, -0.5), False),
        (Column((10.0, 0.0), 0.3, -10.0), False),
        (Ball((4.0, 0.0, -2.5), 0.5), True),
        (Ball((4.0, 0.0, -6.0), 0.5), False),
        (Ball((-4.0, 0.0, -2.5), 2.0), False),
    ],
)
def test_bodies_between_hide_the_target_and_others_do_not(body, hides) -> None:
    bench = Bench(mount=DOWN, bodies=(body,))
    bench.run(2.0)
    assert bool(bench.all(CameraTrackingGeo)) != hides
    # The camera works all the same.
    assert len(bench.all(CameraFovStatus)) >= 8


def test_vehicles_hide_the_target_while_they_are_between() -> None:
    bench = Bench(mount=DOWN, moving={OTHER: Ball((0.0, 0.0, 0.0), 0.5)})
    for k in range(300):
        there = (0.0, 4.0, 3.0) if 100 <= k < 200 else (5.0, 4.0, 3.0)
        bench.step(inbox=(bench.truth(there, OTHER),))
    times = np.array([one.time_boot for one in bench.all(CameraFovStatus)])
    seen = set(bench.times(CameraTrackingGeo))
    found = np.array([time in seen for time in bench.times(CameraFovStatus)])
    between = (times > 1_010_000) & (times < 1_980_000)
    outside = (times < 980_000) | (times > 2_010_000)
    assert not found[between].any()
    assert found[outside].all()


@pytest.mark.parametrize(
    ("target", "why"),
    [
        ((0.0, -8.0, 0.0), "behind"),
        ((9.0, 8.0, 0.0), "beside"),
        ((0.0, 40.0, 0.0), "beyond the range"),
        ((0.0, 8.0, -1.0), "below the ground"),
        (None, "absent"),
    ],
)
def test_what_is_not_in_view_is_not_detected(target, why) -> None:
    bench = Bench(mount=DOWN, range=30.0, target=target)
    bench.run(2.0)
    assert not bench.all(CameraTrackingGeo), why


def test_misses_and_false_detections_have_their_shares() -> None:
    bench = Bench(mount=DOWN, rate_hz=50.0, missed=0.2, false_positives=0.1)
    bench.run(32.0)
    n = len(bench.all(CameraFovStatus))
    near = np.linalg.norm(places(bench) - np.array(bench.target), axis=1) < 3.0
    # Some false ones are near by chance; some imagined ones have no top in front of the camera.
    assert near.sum() / n == pytest.approx(0.9 * 0.8, abs=4 * math.sqrt(0.2 / n) + 0.01)
    assert (~near).sum() / n == pytest.approx(0.1, abs=4 * math.sqrt(0.09 / n) + 0.01)


def test_the_same_seed_gives_the_same_bytes_and_another_one_others() -> None:
    runs = []
    for seed in (1, 1, 2):
        bench = Bench(mount=GIMBAL, sensors="rtk", seed=seed, missed=0.3, false_positives=0.1)
        bench.run(3.0)
        runs.append(bench.datagrams)
    assert runs[0] == runs[1] != runs[2]


def test_a_camera_changes_nothing_of_the_flight() -> None:
    with_camera, without = Bench(mount=DOWN, sensors="rtk"), Bench(mount=DOWN, sensors="rtk", rate_hz=1.0)
    for bench in (with_camera, without):
        bench.run(2.0)
    assert np.array_equal(with_camera.autopilot.state.position, without.autopilot.state.position)


def test_what_is_seen_does_not_change_the_errors_of_later_images() -> None:
    """Each image draws the same number of random numbers, whether the target is hidden or not."""
    free, hidden = Bench(mount=DOWN), Bench(mount=DOWN)
    hidden.target = (0.0, -8.0, 0.0)
    for bench in (free, hidden):
        bench.run(1.0)
        bench.target = (0.0, 8.0, 0.0)
        bench.run(2.0)
    assert np.array_equal(places(free)[-10:], places(hidden)[-10:])


def test_errors_of_the_vehicles_own_estimate_are_in_the_place_but_not_in_the_accuracy() -> None:
    bench, other = (Bench(mount=GIMBAL, sensors=name, **EXACT) for name in ("gnss", "truth"))
    for one in (bench, other):
        one.run(5.0)
    bias = bench.autopilot.estimate_error
    error = places(bench)[-1] - np.array(bench.target)
    assert np.linalg.norm(bias) > 0.1
    # Within the yaw error (1.5°) at 9 m and what the drift is in the latency.
    assert error == pytest.approx(np.array((bias[1], bias[0], -bias[2])), abs=0.6)
    assert np.linalg.norm(error) > 0.05
    assert bench.all(CameraTrackingGeo)[-1].horizontal_accuracy == pytest.approx(0.0, abs=1e-6)


def test_a_gimbal_keeps_the_horizon_and_follows_the_target() -> None:
    bench = Bench(mount={"kind": "gimbal", "pitch_deg": 20.0, "rate_deg_s": 20.0})
    bench.run(3.0)
    for view, gimbal in zip(bench.all(CameraFovStatus), bench.all(GimbalAttitude), strict=False):
        roll, _, yaw = euler(view.attitude)
        assert roll == pytest.approx(0.0, abs=1e-6)
        assert euler(gimbal.attitude)[2] == pytest.approx(0.0, abs=1e-6)
        back = product(quaternion(0.0, 0.0, gimbal.delta_yaw), gimbal.attitude)
        assert rotated(back, (1.0, 0.0, 0.0)) == pytest.approx(
            rotated(view.attitude, (1.0, 0.0, 0.0)), abs=1e-6
        )
        assert gimbal.delta_yaw == pytest.approx(yaw, abs=1e-6)
    aim = math.atan2(5.0 - 0.9, 8.0)
    assert -euler(bench.all(CameraFovStatus)[-1].attitude)[1] == pytest.approx(aim, abs=0.02)


def test_a_gimbal_that_followed_something_false_finds_the_target_again() -> None:
    """It returns to its first pitch; otherwise the target would be out of view for good."""
    bench = Bench(mount=GIMBAL)
    for north in (8.0, 4.5, 3.0):
        bench.target = (0.0, north, 0.0)
        bench.run(2.0)
    bench.target = (0.0, 8.0, 0.0)
    before = len(bench.all(CameraTrackingGeo))
    bench.run(3.0)
    assert len(bench.all(CameraTrackingGeo)) - before > 15


def test_a_gimbal_turns_on_command_no_faster_than_it_can() -> None:
    bench = Bench(mount={"kind": "gimbal", "pitch_deg": 0.0, "follows": False, "rate_deg_s": 30.0})
    bench.run(1.0)
    (answer,) = (m for m in bench.order(1000, -60.0, math.nan, to=(11, 154)) if isinstance(m, CommandAck))
    assert answer.result == mavlink.MAV_RESULT_ACCEPTED
    assert answer.source.component == 154
    bench.run(3.0)
    pitches = np.degrees([euler(one.attitude)[1] for one in bench.all(CameraFovStatus)])
    assert np.abs(np.diff(pitches)).max() <= 3.0 + 1e-4
    assert pitches[-1] == pytest.approx(-60.0, abs=1e-4)


def test_a_camera_says_what_it_is() -> None:
    bench = Bench(mount=DOWN)
    bench.run(1.5)
    for order in ((512, 259), (521, 1)):
        said = bench.order(*order)
        assert [m.result for m in said if isinstance(m, CommandAck)] == [mavlink.MAV_RESULT_ACCEPTED]
        (about,) = (m for m in said if isinstance(m, CameraInformation))
        assert about.resolution == (1280, 720)
        assert about.flags & mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_GEO_STATUS
    beats = [m for m in bench.all(Heartbeat) if m.source.component == 100]
    assert {(m.type, m.autopilot) for m in beats} == {(30, 8)}
    assert len(beats) == 2


def test_a_camera_stops_and_changes_its_rate_on_command() -> None:
    bench = Bench(mount=DOWN)
    bench.run(1.0)
    bench.order(511, 276, 200_000)
    (interval,) = (m for m in bench.order(510, 276) if isinstance(m, MessageInterval))
    assert interval.interval == 200_000
    bench.run(1.0)
    before = len(bench.all(CameraFovStatus))
    bench.run(2.0)
    assert len(bench.all(CameraFovStatus)) - before == 10
    bench.order(511, 276, 3e38)
    (interval,) = (m for m in bench.order(510, 276) if isinstance(m, MessageInterval) and m.interval > 10**6)
    assert interval.interval == 2**31 - 1
    assert [m.result for m in bench.order(511, 276, 5.0) if isinstance(m, CommandAck)] == [
        mavlink.MAV_RESULT_DENIED
    ]
    bench.order(511, 276, 0)
    bench.order(2010)
    bench.run(0.3)
    quiet = len(bench.all(CameraFovStatus))
    bench.run(1.0)
    assert len(bench.all(CameraFovStatus)) == quiet


def test_other_commands_are_refused_by_the_camera_and_not_contradicted_to_all() -> None:
    bench = Bench(mount=DOWN)
    bench.run(1.0)
    (answer,) = (m for m in bench.order(400, 1.0) if isinstance(m, CommandAck))
    assert (answer.source.component, answer.result) == (100, mavlink.MAV_RESULT_UNSUPPORTED)
    assert [m.source.component for m in bench.order(520, 1.0, to=(11, 0)) if isinstance(m, CommandAck)] == [1]
    assert not [m for m in bench.order(512, 259, to=(12, 100)) if isinstance(m, CommandAck)]


def test_settings_leave_out_accuracies_and_the_time() -> None:
    bench = Bench(mount=DOWN, accuracy=False, fov_status=False)
    bench.run(2.0)
    assert not bench.all(CameraFovStatus)
    said = bench.all(CameraTrackingGeo)
    assert said
    assert all(m[6:12] == (None,) * 6 for m in said)


def test_the_clock_of_the_steps_may_start_anywhere() -> None:
    now, later = Bench(mount=GIMBAL, sensors="rtk"), Bench(mount=GIMBAL, sensors="rtk", start=10**15)
    for bench in (now, later):
        bench.run(2.0)
    assert now.datagrams == later.datagrams
