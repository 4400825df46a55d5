"""OBSTACLE_DISTANCE: what is seen stands where it is, for as long as it may be believed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.config.obstacles import Post, ProximityConfig
from companion.obstacles.proximity import Proximity, returns
from companion.obstacles.sensed import Sensed, SensorPose
from companion.obstacles.static import FixedObstacles
from companion.telemetry.reception import accepts
from companion.world import World
from mavlink_bridge.messages import (
    Attitude,
    GpsGlobalOrigin,
    LocalPosition,
    ObstacleDistance,
    Source,
)
from tests.companion.bench import AUTOPILOT, FLEET, START, SYSTEM, Bench, seen_at
from tests.companion.rig import LAWS, QUICK, numbers

CONFIG = ProximityConfig()
SENSOR = Source(SYSTEM, 196)
NOTHING = 20.01
STEP = math.radians(5.0)
NOBODY = np.zeros((0, 3))
HEIGHT = 5.0
HERE = np.tile([0.0, 0.0, HEIGHT], (16, 1))
angles = numbers(-math.pi, math.pi)
frames = st.sampled_from((0, 1, mavlink.MAV_FRAME_BODY_FRD))
ranges = st.floats(0.5, CONFIG.reach)


def scan(distances, frame=mavlink.MAV_FRAME_BODY_FRD, increment=STEP, offset=0.0, source=SENSOR, time=0):
    """``distances`` by sector; all others see nothing."""
    told = tuple(distances.get(k, NOTHING) for k in range(72))
    return ObstacleDistance(source, time, 0, told, increment, 0.2, 20.0, offset, frame)


def sensed(message, place, yaw, north=math.pi / 2, known=NOBODY, now=START):
    """What a vehicle at ``place`` (3,) with its nose to ``yaw`` (ENU) knows after one message."""
    found = Sensed(CompanionConfig(proximity=CONFIG), FLEET)
    found.receive_distances(now, message, SensorPose(now, np.asarray(place, float), yaw, north), known)
    return found


def posts(found, place, now=START):
    return found.around(now, np.asarray(place, float)[None], 1e3)


@LAWS
@given(sector=st.integers(0, 71), far=ranges, frame=frames, yaw=angles, offset=angles, x=numbers(-9, 9))
def test_a_return_stands_at_its_bearing_and_range_whatever_the_frame_and_the_nose(
    sector, far, frame, yaw, offset, x
):
    place = np.array([x, -x, HEIGHT])
    seen = posts(sensed(scan({sector: far}, frame, offset=offset), place, yaw), place)
    bearing = offset + sector * STEP + (math.pi / 2 - yaw if frame == mavlink.MAV_FRAME_BODY_FRD else 0.0)
    expected = place + far * np.array([math.sin(bearing), math.cos(bearing), 0.0])
    assert len(seen.ids) == 1
    np.testing.assert_allclose(seen.positions[0, 0], expected, atol=1e-9)


@LAWS
@given(
    seen=st.dictionaries(st.integers(0, 71), ranges, max_size=12), yaw=angles, turn=angles, body=st.booleans()
)
def test_a_world_that_is_turned_is_seen_turned(seen, yaw, turn, body):
    place = np.array([3.0, 1.0, HEIGHT])
    c, s = math.cos(turn), math.sin(turn)
    matrix = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    message = scan(seen, mavlink.MAV_FRAME_BODY_FRD if body else 0)
    here = posts(sensed(message, place, yaw), place)
    there = posts(sensed(message, matrix @ place, yaw + turn, math.pi / 2 + turn), matrix @ place)
    # Which of two that are equally far comes first is chance.
    one, other = np.argsort(here.ids), np.argsort(there.ids)
    np.testing.assert_allclose(there.positions[other], here.positions[one] @ matrix.T, atol=1e-9)
    np.testing.assert_allclose(there.radius[other], here.radius[one], atol=1e-9)


@LAWS
@given(
    seen=st.dictionaries(st.integers(0, 71), ranges, min_size=1, max_size=40),
    share=numbers(-0.5, 0.5),
    increment=st.sampled_from((STEP, -STEP, 2 * STEP, math.radians(30.0))),
)
def test_whatever_is_there_lies_inside_a_post(seen, share, increment):
    """Anywhere in its sector, at its range."""
    place = np.array([0.0, 0.0, HEIGHT])
    message = scan(seen, 0, increment)
    found = posts(sensed(message, place, None), place)
    full = int(2 * math.pi / abs(increment) + 1e-6)
    for sector, far in seen.items():
        if sector < full:
            bearing = (sector + share) * increment
            point = far * np.array([math.sin(bearing), math.cos(bearing)])
            off = np.linalg.norm(found.positions[:, 0, :2] - point, axis=1)
            assert (off <= found.radius + 1e-9).any()


@LAWS
@given(
    far=st.floats(0.0, 60.0) | st.none(),
    most=numbers(0.5, 30.0),
    reach=numbers(0.5, 30.0),
)
def test_nothing_beyond_what_is_measured_or_counts(far, most, reach):
    message = scan({0: far})._replace(distances=(far, *[None] * 71), min_distance=0.2, max_distance=most)
    found = returns(message, reach)
    assert len(found.ranges) == (far is not None and far <= min(most, reach))


def test_what_touches_the_sensor_is_at_its_least_distance():
    found = returns(scan({3: 0.0}), 15.0)
    assert found.ranges.tolist() == [0.2]


@pytest.mark.parametrize(
    "nonsense",
    [{"increment": 0.0}, {"frame": 8}, {"frame": 255}, {"min_distance": 21.0}, {"max_distance": 0.0}],
)
def test_what_makes_no_sense_is_refused(nonsense):
    found = sensed(scan({0: 3.0})._replace(**nonsense), (0, 0, HEIGHT), 0.0)
    assert posts(found, (0, 0, HEIGHT)).ids == ()
    assert found.proximity.refused == 1


def test_without_a_heading_only_north_counts():
    assert (
        posts(sensed(scan({0: 3.0}, mavlink.MAV_FRAME_BODY_FRD), (0, 0, HEIGHT), None), (0, 0, HEIGHT)).ids
        == ()
    )
    assert len(posts(sensed(scan({0: 3.0}, 0), (0, 0, HEIGHT), None), (0, 0, HEIGHT)).ids) == 1


@LAWS
@given(age=st.integers(0, 2 * CONFIG.age_us))
def test_a_return_is_forgotten_after_its_age_and_not_before(age):
    found = sensed(scan({0: 3.0}), (0, 0, HEIGHT), 0.0)
    assert bool(posts(found, (0, 0, HEIGHT), START + age).ids) == (age <= CONFIG.age_us)
    assert found.proximity.silent(START + age) == (age > CONFIG.age_us)


def test_what_is_seen_again_keeps_its_name():
    """Or a vehicle would not remember on which side it goes round."""
    found = sensed(scan({0: 5.0, 20: 7.0}), (0, 0, HEIGHT), 0.0)
    first = posts(found, (0, 0, HEIGHT))
    again = SensorPose(START + 100_000, np.array([0.1, 0.0, HEIGHT]), 0.0, math.pi / 2)
    found.receive_distances(START + 100_000, scan({0: 5.0, 20: 7.0}), again, NOBODY)
    later = posts(found, (0, 0, HEIGHT), START + 100_000)
    assert sorted(later.ids) == sorted(first.ids)
    assert not (later.positions == first.positions).all()


def test_a_neighbour_that_is_seen_is_that_neighbour():
    neighbour = np.array([[0.0, 4.5, HEIGHT]])
    message = scan({0: 4.2, 36: 4.2}, 0)
    seen = posts(sensed(message, (0, 0, HEIGHT), None, known=neighbour), (0, 0, HEIGHT))
    np.testing.assert_allclose(seen.positions[:, 0], [[0.0, -4.2, HEIGHT]], atol=1e-9)
    above = neighbour + np.array([0.0, 0.0, 3.0])
    assert len(posts(sensed(message, (0, 0, HEIGHT), None, known=above), (0, 0, HEIGHT)).ids) == 2


TOGETHER = st.tuples(st.sampled_from((0, mavlink.MAV_FRAME_BODY_FRD)), angles, st.sampled_from((STEP, -STEP)))


@LAWS
@given(looks=st.lists(TOGETHER, min_size=1, max_size=8, unique=True), bursts=st.integers(1, 4))
def test_of_sensors_that_speak_together_each_counts(looks, bursts):
    """Of one component and one type; the first sector of each sees something."""
    found, place = Proximity(CONFIG), np.array([0.0, 0.0, HEIGHT])
    for k in range(bursts):
        now = START + 20_000 * k
        for row, (frame, offset, increment) in enumerate(looks):
            message = scan({0: 2.0 + row}, frame, increment, offset)
            # What each says once more at the same time is passed over.
            for told in (message, message._replace(distances=scan({0: 1.0}).distances)):
                found.receive(now, now, told, place, 0.0, NOBODY)
    axes = found.around(now, place[None], 1e3)
    far = np.linalg.norm(axes.positions[:, 0, :2], axis=1)
    np.testing.assert_allclose(np.sort(far), 2.0 + np.arange(len(looks)), atol=1e-9)
    assert found.refused == 0


def test_one_sensor_that_says_ever_new_sectors_is_bounded_and_said_to_be_refused():
    found, place = Proximity(CONFIG), np.array([0.0, 0.0, HEIGHT])
    for k in range(1000):
        found.receive(START + k, START + k, scan({0: 2.0 + 0.01 * k}, offset=1e-3 * k), place, 0.0, NOBODY)
    assert found.refused == 1000 - 8


@QUICK
@given(st.integers(0, 99))
def test_however_much_is_told_little_is_kept_and_the_nearest_of_it(seed):
    random = np.random.default_rng(seed)
    found, place = Proximity(CONFIG), np.array([0.0, 0.0, HEIGHT])
    for k in range(40):
        now = START + 21_000 * k
        told = dict(enumerate(random.uniform(1.0, 15.0, 72)))
        source = Source(SYSTEM, int(random.integers(0, 255)))
        found.receive(now, now, scan(told, 0, source=source), place, math.pi / 2, NOBODY)
    axes = found.around(now, place[None], 1e3)
    assert len(axes.ids) == len(set(axes.ids)) == CONFIG.most
    assert found.refused > 0
    assert np.linalg.norm(axes.positions[:, 0, :2], axis=1).max() < 4.0


def told(*messages, config=None, link="autopilot"):
    """A world that flies north at 2 m/s and turns its nose clockwise at 1 rad/s, and hears ``messages``."""
    world = World(config or CompanionConfig(proximity=CONFIG), SYSTEM, 1, FLEET)
    world.receive(START, "autopilot", GpsGlobalOrigin(AUTOPILOT, FLEET.latitude, FLEET.longitude, 488.0, 0))
    for k in range(20):
        now, boot = START + 20_000 * k, 10**6 + 20_000 * k
        north = 2.0 * 0.02 * k
        world.receive(now, "autopilot", LocalPosition(AUTOPILOT, boot, (north, 0.0, -5.0), (2.0, 0.0, 0.0)))
        yaw = 0.02 * k
        if k % 5 == 0:
            world.receive(now, "autopilot", Attitude(AUTOPILOT, boot, 0.0, 0.0, yaw, (0.0, 0.0, 1.0)))
    for message in messages:
        world.receive(START + 400_000, link, message)
    return world


def where(world, now=START + 400_000):
    return world.obstacles(now, world.at(now), HERE)


@QUICK
@given(late=st.integers(0, 300), sector=st.integers(0, 71))
def test_it_is_placed_where_the_vehicle_was_and_looked_when_it_was_true(late, sector):
    """By the autopilot's own stamp; the heading goes on turning between two attitudes."""
    delay = CompanionConfig().own.delay_us
    true = 10**6 + 400_000 - delay - 1000 * late
    seen = where(told(scan({sector: 4.0}, source=AUTOPILOT, time=true)))
    seconds = 1e-6 * (true - 10**6)
    bearing = sector * STEP + seconds
    expected = np.array([4.0 * math.sin(bearing), 2.0 * seconds + 4.0 * math.cos(bearing), HEIGHT])
    np.testing.assert_allclose(seen.positions[0, 0], expected, atol=0.02)


def test_a_sensor_with_a_clock_of_its_own_is_dated_by_its_delay():
    seen = where(told(scan({0: 4.0}, 0, time=1_767_225_600_000_000)))
    seconds = 0.4 - 1e-6 * CONFIG.delay_us + 1e-6 * CompanionConfig().own.delay_us
    np.testing.assert_allclose(seen.positions[0, 0], [0.0, 2.0 * seconds + 4.0, HEIGHT], atol=0.02)


def test_it_acts_as_a_fixed_post_of_its_size():
    config, message = CompanionConfig(proximity=CONFIG), scan({0: 4.0}, 0)
    seen = where(told(message))
    radius = seen.radius[0] - config.field.margin(1)
    post = Post(kind="post", at=tuple(seen.positions[0, 0, :2]), radius=radius)
    fixed = where(told(config=CompanionConfig(obstacles=(post,))))
    for part in ("positions", "d_min", "d_safe", "radius"):
        np.testing.assert_allclose(getattr(seen, part), getattr(fixed, part), atol=1e-9)


def test_only_own_sensors_count_and_only_if_wanted():
    assert where(told(scan({0: 4.0}, 0, source=Source(12, 196)))).ids == ()
    assert where(told(scan({0: 4.0}, 0), config=CompanionConfig())).ids == ()
    off, on = CompanionConfig(), CompanionConfig(proximity=CONFIG)
    for link in ("autopilot", "swarm"):
        assert not accepts(link, SYSTEM, 1, off)(mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE, SYSTEM, 196)
        assert accepts(link, SYSTEM, 1, on)(mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE, SYSTEM, 196)
        assert not accepts(link, SYSTEM, 1, on)(mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE, 12, 196)
    for link in ("target", "ground"):
        assert not accepts(link, SYSTEM, 1, on)(mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE, SYSTEM, 196)


WALL = np.array([[8.0, y] for y in np.arange(-2.0, 2.01, 0.02)])


def looked(place, yaw, points=WALL):
    """Distances to ``points`` (k, 2) by sector, from ``place`` with the nose to ``yaw`` (ENU)."""
    off = points - place[:2]
    bearing = yaw - np.arctan2(off[:, 1], off[:, 0])
    sector = np.round(bearing / STEP).astype(int) % 72
    far = np.linalg.norm(off, axis=1)
    return {int(k): round(float(far[sector == k].min()), 2) for k in np.unique(sector)}


@pytest.mark.parametrize("avoidance", ["field", "certified"])
@pytest.mark.parametrize("frame", [0, mavlink.MAV_FRAME_BODY_FRD])
def test_a_companion_goes_round_a_wall_that_only_its_sensor_sees(frame, avoidance):
    """4 m wide, across the way to a goal 16 m off."""
    bench = Bench(
        start=(0.0, 0.5, 0.0),
        proximity={},
        avoidance=avoidance,
        turning_sense="right" if avoidance == "certified" else "own",
    )
    bench.take_off(5.0)
    bench.go_to((16.0, 0.0, 5.0))
    nearest = math.inf
    for _ in range(300):
        pilot = bench.autopilot
        nose = pilot.yaw if frame == mavlink.MAV_FRAME_BODY_FRD else math.pi / 2
        message = scan(looked(pilot.position, nose), frame, source=AUTOPILOT, time=bench.now - START)
        bench.step(bench.datagram("autopilot", message))
        bench.fly(0.09)
        nearest = min(nearest, float(np.linalg.norm(WALL - pilot.position[:2], axis=1).min()))
    assert np.linalg.norm(bench.autopilot.position - (16.0, 0.0, 5.0)) < 0.3
    assert nearest > bench.config.field.d_min
    # Nothing is seen any more, and nothing is left.
    bench.fly(1.5)
    assert bench.companion.world.sensed.around(bench.now, np.zeros((1, 3)), 1e3).ids == ()


def test_a_wall_that_nobody_sees_is_flown_through():
    """So that the law above says something."""
    bench = Bench(start=(0.0, 0.5, 0.0)).take_off(5.0)
    bench.go_to((16.0, 0.0, 5.0))
    nearest = math.inf
    for _ in range(100):
        bench.fly(0.1)
        nearest = min(nearest, float(np.linalg.norm(WALL - bench.autopilot.position[:2], axis=1).min()))
    # At 5 m/s it is looked for every half metre.
    assert nearest < 0.3


def test_the_fixed_and_the_seen_do_not_share_names():
    fixed = FixedObstacles(tuple(Post(kind="post", at=(0.0, 0.0), radius=1.0) for _ in range(500)))
    names = fixed.around(np.zeros((1, 3)), 1e3).ids
    assert max(names) < min(posts(sensed(scan({0: 3.0}), (0, 0, 5.0), 0.0), (0, 0, 5.0)).ids)


def test_a_neighbour_heard_on_the_swarm_link_is_not_seen_twice():
    bench = Bench(proximity={}).take_off(5.0)
    for _ in range(10):
        there = bench.autopilot.position + np.array([0.0, 4.0, 0.0])
        bench.step(bench.datagram("swarm", seen_at(12, there)))
        bench.fly(0.05)
        bench.step(bench.datagram("autopilot", scan({0: 3.8}, 0)))
    view = bench.companion.world.at(bench.now)
    assert bench.companion.world.obstacles(bench.now, view, HERE).ids == (12,)
