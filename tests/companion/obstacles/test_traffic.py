"""ADSB_VEHICLE: the way of traffic is kept clear, however wrong its height; what is absurd is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.field.forces import repulsion
from companion.config import CompanionConfig
from companion.config.obstacles import TrafficConfig
from companion.obstacles.traffic import FIRST_ID, Traffic
from companion.telemetry.reception import accepts
from companion.world import World
from mavlink_bridge.messages import AdsbVehicle, Source
from tests.companion.bench import FLEET, START, SYSTEM, Bench
from tests.companion.rig import LAWS, QUICK, numbers, vectors

CONFIG = TrafficConfig()
RECEIVER = Source(SYSTEM, 156)
ZERO = np.zeros(3)
HERE = np.tile([0.0, 0.0, 5.0], (16, 1))
FAR = 1e6


def message(address=7, course=0.0, speed=60.0, climb=0.0, age=0, altitude=500.0, place=(0.0, 0.0, 5.0)):
    latitude, longitude, _ = FLEET.to_geodetic(place)
    return AdsbVehicle(
        RECEIVER, address, latitude, longitude, altitude, True, course, speed, climb, "HB", 1, age
    )


def received(place, now=START, here=ZERO, traffic=None, **more):
    found = Traffic(CONFIG) if traffic is None else traffic
    found.receive(now, message(**more), np.asarray(place, float), here)
    return found


def around(traffic, points=HERE, now=START, reach=FAR):
    return traffic.around(now, np.asarray(points, float), reach)


@LAWS
@given(
    place=vectors(500.0),
    course=numbers(-math.pi, math.pi),
    speed=numbers(2.0, 100.0),
    climb=numbers(-10.0, 10.0),
    own=vectors(200.0),
    later=st.integers(0, 5_000_000),
    share=numbers(0.0, 1.0),
)
def test_no_point_of_its_way_is_nearer_than_what_is_told(place, course, speed, climb, own, later, share):
    """Seen from above, where its height may be wrong; and what is told is on its way."""
    traffic = received(place, course=course, speed=speed, climb=climb)
    nearest = around(traffic, own[None], START + later).positions[0, 0]
    v = np.array([speed * math.sin(course), speed * math.cos(course), climb])
    begin = place + 1e-6 * later * v
    point = begin + share * 1e-6 * CONFIG.ahead_us * v
    told, there = (float(np.linalg.norm((x - own)[:2])) for x in (nearest, point))
    assert told <= max(there, 1.0) + 1e-6
    assert abs(nearest[2] - own[2]) <= max(abs(point[2] - own[2]), 0.0) + 10.0 * abs(climb) + 1e-6


@LAWS
@given(turn=numbers(-math.pi, math.pi), place=vectors(300.0), course=numbers(-3.0, 3.0), own=vectors(50.0))
def test_a_world_that_is_turned_is_seen_turned(turn, place, course, own):
    c, s = math.cos(turn), math.sin(turn)
    matrix = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    here = around(received(place, course=course), own[None]).positions[0, 0]
    there = around(received(matrix @ place, course=course - turn), (matrix @ own)[None]).positions[0, 0]
    np.testing.assert_allclose(there, matrix @ here, atol=1e-6)


@given(height=numbers(-1000.0, 1000.0))
def test_its_height_counts_as_far_as_it_is_known(height):
    known = around(received((300.0, 0.0, height))).positions[0, 0]
    assert abs(known[2] - 5.0) == pytest.approx(max(abs(height - 5.0) - CONFIG.height_error, 0.0))
    assert around(received((300.0, 0.0, height), altitude=None)).positions[0, 0, 2] == 5.0


def test_without_course_or_speed_it_stands():
    for more in ({"course": None}, {"speed": None}):
        traffic = received((300.0, 0.0, 5.0), **more)
        np.testing.assert_allclose(around(traffic, now=START + 5_000_000).positions[0, 0], (300.0, 0.0, 5.0))


@given(age=st.integers(0, 12), later=st.integers(0, 12_000_000))
def test_it_is_forgotten_after_its_age_which_counts_from_when_it_was_true(age, later):
    traffic = received((100.0, 0.0, 5.0), age=age * 1_000_000)
    known = age * 1_000_000 <= CONFIG.age_us and later + age * 1_000_000 <= CONFIG.age_us
    assert bool(around(traffic, now=START + later).ids) == known


@pytest.mark.parametrize(
    "more",
    [
        {"speed": 351.0},
        {"climb": -61.0},
        {"address": 1 << 24},
        {"place": (3001.0, 0.0, 5.0)},
        {"place": (0.0, 0.0, 30_001.0)},
        {"place": (0.0, math.nan, 5.0)},
        {"place": (0.0, 0.0, math.nan)},
    ],
)
def test_what_cannot_be_or_does_not_matter_is_refused(more):
    place = more.pop("place", (100.0, 0.0, 5.0))
    traffic = received(place, **more)
    assert (len(traffic), traffic.refused) == (0, 1)


def test_the_own_transponder_is_no_traffic():
    traffic = Traffic(TrafficConfig(ignore=(7,)))
    received((5.0, 0.0, 5.0), traffic=traffic)
    assert len(traffic) == 0


def test_one_that_is_elsewhere_at_once_is_not_the_one_that_was_heard():
    traffic = received((100.0, 0.0, 5.0), speed=0.0)
    received((2000.0, 0.0, 5.0), START + 1_000_000, traffic=traffic, speed=0.0)
    assert around(traffic).positions[0, 0, 0] == pytest.approx(100.0)
    received((2000.0, 0.0, 5.0), START + 20_000_000, traffic=traffic, speed=0.0)
    assert around(traffic, now=START + 20_000_000).positions[0, 0, 0] == pytest.approx(2000.0)


@QUICK
@given(seed=st.integers(0, 99))
def test_of_many_the_nearest_count(seed):
    random = np.random.default_rng(seed)
    traffic, far = Traffic(CONFIG), random.permutation(np.arange(100.0, 2100.0, 20.0))
    for address, distance in enumerate(far):
        received((distance, 0.0, 5.0), traffic=traffic, address=address)
    assert len(traffic) == CONFIG.most
    nearest = {FIRST_ID + int(k) for k in np.argsort(far)[: CONFIG.most]}
    assert set(around(traffic).ids) == nearest


def test_who_is_right_before_it_goes_to_its_right():
    """Northward: to the east."""
    nearest = around(received((0.0, -300.0, 5.0), course=0.0)).positions[0]
    assert (HERE - nearest)[0] @ (1.0, 0.0, 0.0) > 0.9


@pytest.mark.parametrize(("link", "sender"), [("autopilot", 11), ("swarm", 11), ("swarm", 12)])
def test_it_is_heard_where_a_receiver_may_be(link, sender):
    off, on = CompanionConfig(), CompanionConfig(traffic=CONFIG)
    assert accepts(link, SYSTEM, 1, on)(mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE, sender, 156)
    assert not accepts(link, SYSTEM, 1, off)(mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE, sender, 156)
    world = World(on, SYSTEM, 1, FLEET)
    world.receive(START, link, message(place=(34.0, 0.0, 5.0))._replace(source=Source(sender, 156)))
    seen = world.obstacles(START, world.at(START), HERE)
    assert seen.ids == (FIRST_ID + 7,)
    assert seen.radius[0] == CONFIG.radius + on.field.margin(1)
    world = World(off, SYSTEM, 1, FLEET)
    world.receive(START, link, message(place=(34.0, 0.0, 5.0)))
    assert world.obstacles(START, world.at(START), HERE).ids == ()


def test_others_have_no_say_on_the_autopilots_link():
    on = CompanionConfig(traffic=CONFIG)
    assert not accepts("autopilot", SYSTEM, 1, on)(mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE, 12, 156)
    for link in ("target", "ground"):
        assert not accepts(link, SYSTEM, 1, on)(mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE, SYSTEM, 156)


def flown(avoidance, told):
    """How near a light aircraft, along the line x = 4 to the north at 40 m/s, comes to one that hovers at the
    fleet's origin; and where that is in the end."""
    limits = {"box_min": (-60.0, -60.0, 3.0), "box_max": (60.0, 60.0, 30.0)}
    bench = Bench(avoidance=avoidance, limits=limits, traffic={"radius": 15.0}).take_off(5.0)
    bench.go_to((0.0, 0.0, 5.0))
    bench.fly(1.0)
    begin, nearest = bench.now, math.inf
    while bench.now < begin + 25_000_000:
        place = np.array([4.0, -600.0 + 40e-6 * (bench.now - begin), 20.0])
        if told and (bench.now - begin) % 1_000_000 == 0:
            told_at = message(place=place, speed=40.0, altitude=FLEET.altitude + 20.0)
            bench.step(bench.datagram("autopilot", told_at))
        else:
            bench.step()
        nearest = min(nearest, float(np.linalg.norm((place - bench.autopilot.position)[:2])))
        assert np.abs(bench.autopilot.velocity).max() <= max(bench.config.limits.v_max) + 0.1
    bench.fly(25.0)
    return nearest, bench.autopilot.position


@pytest.mark.parametrize("avoidance", ["field", "certified"])
def test_a_companion_gives_way_and_comes_back(avoidance):
    nearest, rest = flown(avoidance, told=True)
    assert nearest > 15.0
    assert np.linalg.norm(rest - (0.0, 0.0, 5.0)) < 0.3


def test_without_a_receiver_it_stays():
    assert flown("field", told=False)[0] < 4.5


def off_path(point, place, course):
    """The horizontal distance (m) of ``point`` from the path, and on which side of it the point is."""
    way = 60.0 * 1e-6 * CONFIG.ahead_us * np.array([math.sin(course), math.cos(course)])
    off = (point - place)[:2]
    share = min(max(off @ way / (way @ way), 0.0), 1.0)
    return np.linalg.norm(off - share * way), np.sign(way[0] * off[1] - way[1] * off[0])


ON_THE_PATH = [
    example(goal=np.array([0.0, 50.0, 0.0]), own=np.array([x, 50.0, 0.0]), place=ZERO, course=0.0, clear=1.0)
    for x in (-20.0, 20.0)
] + [
    example(
        goal=np.array([0.0, -50.0, 0.0]), own=np.array([x, -50.0, 0.0]), place=ZERO, course=math.pi, clear=1.5
    )
    for x in (-30.0, 30.0)
]


@LAWS
@example(goal=np.zeros(3), own=np.array([1.0, 0, 0]), place=np.array([1.0, 0, 51]), course=0.0, clear=1.0)
@example(goal=np.array([0, -25.0, 0]), own=np.zeros(3), place=np.array([1.0, 0, 0]), course=2.0, clear=1.0)
@ON_THE_PATH[0]
@ON_THE_PATH[1]
@ON_THE_PATH[2]
@ON_THE_PATH[3]
@given(
    goal=vectors(60.0),
    own=vectors(60.0),
    place=vectors(200.0),
    course=numbers(-math.pi, math.pi),
    clear=numbers(0.5, 5),
)
def test_a_goal_is_moved_just_off_its_way_or_not_at_all(goal, own, place, course, clear):
    """And not to the other side of it, if the vehicle is beside it."""
    traffic = received(place, course=course)
    moved, room = traffic.outside(START, goal, own, clear), CONFIG.radius + clear
    before, _ = off_path(goal, place, course)
    distance, side = off_path(moved, place, course)
    assert moved[2] == goal[2]
    if before >= room:
        np.testing.assert_array_equal(moved, goal)
    if not np.array_equal(moved, goal):
        assert distance == pytest.approx(room, abs=1e-4)
        inside, own_side = off_path(own, place, course)
        level = np.linalg.norm(own - around(traffic, own[None]).positions[0, 0]) < room - 1.0
        if inside < room - 1e-3 and level and (own - place)[:2] @ [math.sin(course), math.cos(course)] > 0.0:
            assert side == own_side or inside < 1e-3


@LAWS
@given(place=vectors(40.0), course=numbers(-3.0, 3.0))
def test_deep_in_its_room_the_field_pushes_gently(place, course):
    """Or it would fling the vehicle out, faster than it may fly."""
    config = CompanionConfig(traffic=CONFIG)
    world = World(config, SYSTEM, 1, FLEET)
    told = message(place=place, course=course, altitude=FLEET.altitude + place[2])
    world.receive(START, "autopilot", told)
    seen = world.obstacles(START, world.at(START), HERE)
    if seen.ids:
        force = repulsion(HERE, seen, config.field.gain, config.limits.a_total, None, 0.1)
        assert np.linalg.norm(force, axis=1).max() < max(config.limits.u_max)
