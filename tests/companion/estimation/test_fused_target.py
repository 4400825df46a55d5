"""What counts as a detection, when its image was taken, and what is said of it to the others."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.estimation.fused_target import FusedTarget
from companion.telemetry.reception import accepts
from companion.world import World
from mavlink_bridge.messages import (
    Attitude,
    CameraFovStatus,
    CameraTrackingGeo,
    CameraTrackingImage,
    GimbalAttitude,
    GlobalPosition,
    GpsGlobalOrigin,
    LocalPosition,
    Source,
)
from mavlink_bridge.pinhole import Pinhole, conjugate, extent, product, rotated, upward
from mavlink_bridge.wire.codec import Codec
from sitl.values.attitudes import quaternion
from tests.companion.estimation.cameras import FLEET, START, message, source_of

OWN, NEIGHBOUR, TARGET = 11, 12, 1
CAMERA = np.array([6.0, 0.0, 5.0])
OTHER = np.array([0.0, 6.0, 5.0])
PLACE = np.zeros(3)


def world(**source) -> World:
    config = CompanionConfig.model_validate(
        {"target_source": {"kind": "fused", **source}, "target": {"rewind_us": 2_000_000}}
    )
    found = World(config, OWN, TARGET, FLEET)
    found.receive(
        START,
        "autopilot",
        GpsGlobalOrigin(Source(OWN, 1), FLEET.latitude, FLEET.longitude, FLEET.altitude, 0),
    )
    return found


def heard(of: World, now: int, *, neighbour: bool = True) -> None:
    """Own position, and the neighbour's: 5 ms and 20 ms old when they arrive."""
    north, east, down = CAMERA[1], CAMERA[0], -CAMERA[2]
    stamp = now - START
    of.receive(
        now, "autopilot", LocalPosition(Source(OWN, 1), stamp - 5_000, (north, east, down), (0.0, 0.0, 0.0))
    )
    if neighbour:
        state = GlobalPosition(
            Source(NEIGHBOUR, 191), stamp - 20_000, *FLEET.to_geodetic(OTHER), 5.0, (0.0, 0.0, 0.0), None
        )
        of.receive(now, "swarm", state)


def view(system: int, component: int, stamp: int, place) -> CameraFovStatus:
    return CameraFovStatus(
        Source(system, component), stamp, FLEET.to_geodetic(place), None, (1.0, 0.0, 0.0, 0.0), 1.2, 0.8
    )


def own_detection(stamp: int, place=PLACE) -> tuple[CameraFovStatus, CameraTrackingGeo]:
    return view(OWN, 100, stamp, CAMERA), message(OWN, place, CAMERA)


def forwarded(stamp: int, place=PLACE, system: int = NEIGHBOUR) -> tuple[CameraFovStatus, CameraTrackingGeo]:
    said = message(system, place, OTHER)._replace(source=Source(system, 191))
    return view(system, 191, stamp, OTHER), said


def give(of: World, now: int, link: str, messages) -> None:
    for one in messages:
        of.receive(now, link, one)


def started(**source) -> tuple[World, int]:
    found = world(**source)
    now = START + 1_000_000
    for tick in range(10):
        now = START + 1_000_000 + 100_000 * tick
        heard(found, now)
    return found, now


def test_own_detections_and_forwarded_ones_are_dated_by_the_image():
    of, now = started()
    give(of, now, "autopilot", own_detection(now - START - 150_000))
    assert of.target.age(now) == pytest.approx(150_000, abs=10_000)
    give(of, now + 10_000, "swarm", forwarded(now - START - 60_000))
    assert of.target.age(now) == pytest.approx(60_000, abs=25_000)
    counts = of.target.counts
    assert (counts.own, counts.others, counts.used, counts.invalid, counts.late) == (1, 1, 2, 0, 0)
    assert of.target.last(now).position == pytest.approx(PLACE, abs=0.1)


@pytest.mark.parametrize("rate", [0.6, -0.6])
def test_the_state_turns_as_the_target_does(rate):
    """It walks round a circle at 1.5 m/s; two cameras know about half of its acceleration."""
    exact = {"sigma_horizontal": 0.02, "sigma_vertical": 0.02, "sigma_yaw_deg": 0.1, "sigma_tilt_deg": 0.1}
    of = world(own_errors=exact)
    for tick in range(50):
        now = START + 1_000_000 + 100_000 * tick
        heard(of, now)
        angle = rate * 0.1 * tick
        place = 2.5 * np.array([np.cos(angle), np.sin(angle), 0.0])
        give(of, now + 1_000, "autopilot", own_detection(now - START, place))
        give(of, now + 2_000, "swarm", forwarded(now - START, place))
    assert 0.3 < of.target.last(now + 2_000).turn_rate / rate < 1.2
    assert of.at(now + 2_000).target.turn_rate == of.target.last(now + 2_000).turn_rate


def test_without_the_time_of_the_image_it_is_as_old_as_configured():
    of, now = started(latency_us=300_000)
    give(of, now, "autopilot", own_detection(0)[1:])
    assert of.target.age(now) == 300_000


SEEN, SAID = own_detection(1_800_000)
UNUSABLE = {
    "no vehicle of the fleet": ("swarm", forwarded(1_900_000, system=77)),
    "no time": ("swarm", forwarded(1_900_000)[1:]),
    "a neighbour's future": ("swarm", forwarded(20_000_000)),
    "the future": ("autopilot", own_detection(20_000_000)),
    "accuracy": ("autopilot", (SEEN, SAID._replace(horizontal_accuracy=1e9))),
    "another target": ("autopilot", (SEEN, SAID._replace(device=3))),
    "not tracking": ("autopilot", (SEEN, SAID._replace(status=0))),
    "far away": ("autopilot", (SEEN, SAID._replace(altitude=1e30))),
}


@pytest.mark.parametrize(("link", "messages"), UNUSABLE.values(), ids=UNUSABLE.keys())
def test_what_cannot_be_used_is_counted_and_dropped(link, messages):
    of, now = started(device=0)
    give(of, now, link, messages)
    assert of.target.counts.invalid == 1
    assert of.target.counts.used == 0
    assert of.target.last(now) is None


def test_a_listed_fleet_excludes_others():
    of, now = started(vehicles=[13])
    give(of, now, "swarm", forwarded(now - START - 60_000))
    assert of.target.counts.invalid == 1
    give(of, now, "autopilot", own_detection(now - START - 150_000))
    assert of.target.counts.own == 1


def test_a_detection_that_arrives_twice_counts_once():
    of, now = started()
    for later in (0, 20_000):
        give(of, now + later, "swarm", forwarded(now - START - 60_000))
    assert (of.target.counts.used, of.target.counts.invalid) == (1, 1)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_place_that_is_no_number_is_counted_as_bad_and_dropped(value):
    codec = Codec()
    assert codec.feed(codec.encode(SAID._replace(altitude=value))) == []
    assert (codec.counters.good, codec.counters.bad) == (0, 1)


def test_an_accuracy_that_is_no_number_is_unknown_and_the_configured_one_counts():
    """NaN is what cameras fill in for what they do not know."""
    nan, codec = float("nan"), Codec()
    bare = SAID._replace(horizontal_accuracy=nan, vertical_accuracy=nan, heading_accuracy=nan)
    (said,) = codec.feed(codec.encode(bare))
    sigmas = []
    for share in (0.05, 0.2):
        of, now = started(sigma_range_share=share)
        give(of, now, "autopilot", (view(OWN, 100, now - START - 150_000, CAMERA), said))
        assert (of.target.counts.used, of.target.counts.invalid) == (1, 0)
        sigmas.append(of.target.last(now).sigma)
    assert sigmas[1] > 1.5 * sigmas[0]


def test_own_detections_are_forwarded_once_with_the_time_of_their_image():
    of, now = started()
    assert of.forwards(now) == []
    give(of, now, "autopilot", own_detection(now - START - 150_000))
    (out,) = of.forwards(now)
    assert out.time == pytest.approx(now - 150_000, abs=10_000)
    assert of.forwards(now + 10_000) == []
    give(of, now + 20_000, "autopilot", own_detection(now - START - 130_000))
    assert of.forwards(now + 20_000) == []
    assert len(of.forwards(now + 100_000)) == 1


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


def test_a_step_asks_the_filter_once_and_again_after_a_detection(monkeypatch):
    """A plan, the log, the status and the metrics ask for the same time."""
    of, now = started()
    give(of, now, "autopilot", own_detection(now - START - 150_000))
    asked, fusion = [], of.target._fusion
    answer = fusion.at
    monkeypatch.setattr(fusion, "at", lambda time, longest: asked.append(time) or answer(time, longest))
    before = of.at(now).target
    of.target.record(now)
    of.target.at(now), of.target.covariance(now), of.target.age(now)
    assert asked == [now]
    # Between the last two: what is known at ``now`` has changed.
    give(of, now, "swarm", forwarded(now - START - 60_000, PLACE + 0.1))
    after = of.target.last(now)
    assert asked == [now, now]
    assert np.linalg.norm(after.position - before.position) > 0.01
    of.target.last(now + 1)
    assert asked == [now, now, now + 1]


def lossy(share: float, vehicles=(11, 12, 13, 14), blind=(), seconds: float = 30.0, since: float = 10.0):
    """Yield the weights that vehicle 11 measures, each tenth of a second from 10 s on.

    It receives its own detections, and detections and positions of the other ``vehicles`` with the
    probability ``share``, each datagram by itself; the vehicles ``blind`` see nothing from ``since`` (s) on.
    """
    source = source_of("truth")
    config = CompanionConfig.model_validate({"target": {"rewind_us": 2_000_000}})
    of, random = FusedTarget(config, source, OWN, FLEET), np.random.default_rng(8)
    cameras = {
        system: np.array([6.0 * np.cos(1.57 * k), 6.0 * np.sin(1.57 * k), 5.0])
        for k, system in enumerate(vehicles)
    }
    for tick in range(round(10.0 * seconds)):
        now = START + 100_000 * tick
        for system, camera in cameras.items():
            sent = message(system, PLACE, camera)
            if system != OWN and random.uniform() <= share:
                of.heard(now, sent.source, now - START + 1)
            if system != OWN and random.uniform() > share:
                continue
            if system not in blind or tick <= 10.0 * since:
                of.receive(now, now - 60_000, tuple(camera), None, sent)
        if tick > 100:
            yield of.sight(now, 1.0).weights


@pytest.mark.parametrize("vehicles", [(11, 12, 13, 14), (11, 12)], ids=len)
def test_a_camera_counts_though_most_of_its_messages_are_lost(vehicles):
    """Over two seconds, nine of ten lost, one of eight cameras would count as one that sees nothing."""
    full = next(iter(lossy(1.0, vehicles)))
    found = np.array(
        [[weights.get(system, 0.0) / full[system] for system in full] for weights in lossy(0.1, vehicles)]
    )
    assert np.mean(found > 0.2) > 0.995
    assert np.mean(found) > 0.85


def test_a_camera_that_sees_nothing_counts_for_nothing():
    found = lossy(1.0, blind={13}, since=-1.0)
    assert all(13 not in weights and len(weights) == 3 for weights in found)


BLIND = {
    "one of two": ((11, 12), {12}),
    "one of three": ((11, 12, 13), {12}),
    "both others": ((11, 12, 13), {12, 13}),
}


@pytest.mark.parametrize(("vehicles", "blind"), BLIND.values(), ids=BLIND.keys())
@pytest.mark.parametrize(("share", "seconds"), [(1.0, 2.5), (0.8, 4.0), (0.1, 17.0)])
def test_a_camera_that_becomes_blind_soon_counts_for_nothing(vehicles, blind, share, seconds):
    """Without lost messages after the base span of two seconds, whoever else sees."""
    before, *found = lossy(share, vehicles, blind, 10.0 + seconds + 5.0, since=10.0)
    assert set(before) == set(vehicles)
    assert all(set(weights) == set(vehicles) - blind for weights in found[round(10.0 * seconds) :])


def test_a_camera_behind_a_worse_link_counts_as_much():
    """Nine of ten messages of vehicle 12 are lost, none of 13: compared in number, 12 would see little."""
    source = source_of("truth")
    config = CompanionConfig.model_validate({"target": {"rewind_us": 2_000_000}})
    of, random, found = FusedTarget(config, source, OWN, FLEET), np.random.default_rng(8), []
    for tick in range(300):
        now = START + 100_000 * tick
        for system, share in ((11, 1.0), (12, 0.1), (13, 1.0)):
            sent = message(system, PLACE, OTHER)
            if random.uniform() <= share:
                of.heard(now, sent.source, now - START + 1)
            if random.uniform() <= share:
                of.receive(now, now - 60_000, tuple(OTHER), None, sent)
        weights = of.sight(now, 1.0).weights
        if tick > 100:
            found.append(weights.get(12, 0.0) / weights[13])
    assert np.min(found) > 0.5
    assert np.mean(found) > 0.95


def test_positions_of_the_fleet_tell_that_a_neighbour_is_heard():
    """The whole way, by messages: a neighbour that reports its position and no detection does not see."""
    of, now = started()
    for tick in range(100):
        now += 100_000
        heard(of, now)
        give(of, now, "autopilot", own_detection(now - START - 150_000))
        if tick < 50:
            give(of, now, "swarm", forwarded(now - START - 60_000))
        if tick == 49:
            assert set(of.sight(now, 1.0).weights) == {OWN, NEIGHBOUR}
        if tick == 80:
            assert set(of.sight(now, 1.0).weights) == {OWN}
