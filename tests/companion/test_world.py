"""The world picture: frames and signs of what arrives, and who may say it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config import CompanionConfig
from companion.world import View, World
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Attitude, GlobalPosition, GpsGlobalOrigin, LocalPosition, Source
from tests.companion.rig import LAWS, ZERO, vectors

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
AUTOPILOT, TARGET = Source(11, 1), Source(1, 1)
NOW = 1_767_225_600_000_000
CONFIG = CompanionConfig()
HERE = np.broadcast_to(np.array([0.0, 0.0, 5.0]), (16, 3))
AT_FLEET_ZERO = GpsGlobalOrigin(AUTOPILOT, 47.397742, 8.545594, 488.0, 0)


def local(ned, velocity_ned=(0.0, 0.0, 0.0), source=AUTOPILOT):
    return LocalPosition(source, 0, tuple(map(float, ned)), tuple(map(float, velocity_ned)))


def attitude(yaw, source=AUTOPILOT):
    return Attitude(source, 0, 0.0, 0.0, yaw, (0.0, 0.0, 0.0))


def target(x, velocity_ned=(0.0, 0.0, 0.0), source=TARGET):
    latitude, longitude, altitude = FLEET.to_geodetic(x)
    return GlobalPosition(source, 0, latitude, longitude, altitude, 0.0, velocity_ned, None)


def world(*received, config=CONFIG):
    """A world that heard (link, message) pairs at ``NOW``."""
    picture = World(config, AUTOPILOT.system, TARGET.system, FLEET)
    for link, message in received:
        picture.receive(NOW, link, message)
    return picture


def test_at_first_nothing_is_known():
    view = world().at(NOW)
    assert view == View(None, None, None, None)


def test_without_an_origin_a_local_position_means_nothing():
    view = world(("autopilot", local((1, 2, -3))), ("autopilot", attitude(0.5))).at(NOW)
    assert (view.own, view.yaw) == (None, None)


@pytest.mark.parametrize(
    ("ned", "enu"), [((1, 0, 0), (0, 1, 0)), ((0, 1, 0), (1, 0, 0)), ((0, 0, 1), (0, 0, -1))]
)
def test_ned_becomes_enu(ned, enu):
    received = local(np.multiply(ned, 7), np.multiply(ned, 2))
    view = world(("autopilot", AT_FLEET_ZERO), ("autopilot", received)).at(NOW - CONFIG.own.delay_us)
    np.testing.assert_allclose(view.own.position, np.multiply(enu, 7), atol=1e-6)
    np.testing.assert_allclose(view.own.velocity, np.multiply(enu, 2), atol=1e-6)


@pytest.mark.parametrize(
    ("north", "east"),
    [(0.0, math.pi / 2), (math.pi / 2, 0.0), (math.pi, -math.pi / 2), (-math.pi / 2, math.pi)],
)
def test_yaw_from_north_becomes_yaw_from_east(north, east):
    view = world(("autopilot", AT_FLEET_ZERO), ("autopilot", attitude(north))).at(NOW)
    assert math.remainder(view.yaw - east, math.tau) == pytest.approx(0.0, abs=1e-9)


@LAWS
@given(place=vectors(300.0), ned=vectors(30.0))
def test_the_own_origin_makes_no_difference(place, ned):
    """Vehicles that were switched on at different places agree about one point."""
    latitude, longitude, altitude = FLEET.to_geodetic(place)
    origin = GpsGlobalOrigin(AUTOPILOT, latitude, longitude, altitude, 0)
    view = world(("autopilot", origin), ("autopilot", local(ned))).at(NOW)
    point = FLEET.to_geodetic(view.own.position)
    frame = FLEET.local(latitude, longitude, altitude)
    np.testing.assert_allclose(frame.position_to_local(FLEET.to_enu(*point)), ned, atol=1e-4)


@pytest.mark.parametrize("link", ["swarm", "target", "ground"])
def test_the_own_state_comes_from_the_autopilots_link_alone(link):
    received = [(link, AT_FLEET_ZERO), (link, local((1, 2, -3))), (link, attitude(0.5))]
    assert world(*received).at(NOW) == View(None, None, None, None)


def test_another_systems_state_is_not_the_own():
    other = Source(12, 1)
    received = [
        ("autopilot", AT_FLEET_ZERO),
        ("autopilot", local((1, 2, -3), source=other)),
        ("autopilot", attitude(0.5, other)),
    ]
    view = world(*received).at(NOW)
    assert (view.own, view.yaw) == (None, None)


@LAWS
@given(x=vectors(50.0), down=st.floats(-3.0, 3.0), up=st.booleans())
def test_the_targets_vertical_speed_has_the_sign_it_is_configured_to_have(x, down, up):
    config = CompanionConfig.model_validate({"target": {"velocity_up": up}})
    view = world(("target", target(x, (1.0, 2.0, down))), config=config).at(NOW)
    np.testing.assert_allclose(view.target.velocity, [2.0, 1.0, down if up else -down], atol=1e-9)


def test_a_target_is_who_is_named_and_only_on_its_link():
    for link, source in (("target", Source(2, 1)), ("swarm", TARGET), ("autopilot", TARGET)):
        assert world((link, target(ZERO, source=source))).at(NOW).target is None


def test_the_target_is_an_obstacle_only_if_told_so():
    x, v = np.array([3.0, 1.0, 5.0]), (0.5, -1.0, 0.0)
    picture = world(("target", target(x, v)))
    assert picture.obstacles(NOW, picture.at(NOW), HERE).ids == ()
    config = CompanionConfig(target_d_min=1.0, target_d_safe=4.0)
    picture = world(("target", target(x, v)), ("swarm", target(-x, source=Source(12, 1))), config=config)
    view = picture.at(NOW)
    obstacles = picture.obstacles(NOW, view, HERE)
    assert obstacles.ids == (12, 1)
    np.testing.assert_array_equal(obstacles.d_min, [config.field.d_min, 1.0])
    np.testing.assert_array_equal(obstacles.d_safe, [config.field.d_safe, 4.0])
    ahead = 0.1 * np.arange(16)[:, None]
    np.testing.assert_allclose(
        obstacles.positions[1], view.target.position + ahead * np.array([-1.0, 0.5, 0.0]), atol=1e-9
    )


@LAWS
@given(x=vectors(8.0), v=vectors(3.0), silence=st.integers(0, 10**10))
def test_a_target_that_falls_silent_is_not_followed_but_stays_an_obstacle(x, v, silence):
    """Carried on for a bounded time, as everybody: it may well be there."""
    config = CompanionConfig(target_d_min=1.0, target_d_safe=4.0)
    ned = (float(v[1]), float(v[0]), float(-v[2]))
    picture = world(("target", target(x, ned)), config=config)
    now = NOW - config.target.delay_us + silence
    view = picture.at(now)
    assert (view.target is None) == (silence > config.guard.target_stale_us)
    obstacles = picture.obstacles(now, view, HERE)
    assert (obstacles.ids, obstacles.d_min) == ((TARGET.system,), [1.0])
    carried = 1e-6 * min(silence, config.target.extrapolate_us)
    np.testing.assert_allclose(obstacles.positions[0, 0], x + carried * v, atol=0.05)


@pytest.mark.parametrize(
    "nonsense",
    [
        local((1e30, 0, 0)),
        local((0, 0, 0), (0, -3e38, 0)),
        local((2e7, 0, 0)),
        local((0, 0, 0), (2e3, 0, 0)),
    ],
    ids=["far beyond everything", "faster than everything", "round the earth", "a bullet"],
)
def test_a_state_that_no_vehicle_can_have_is_not_taken(nonsense):
    """Numbers that are finite, soundly framed and absurd."""
    first = [("autopilot", AT_FLEET_ZERO)]
    assert world(*first, *[("autopilot", nonsense)] * 3).at(NOW).own is None
    known = world(*first, ("autopilot", local((1, 2, -3))), *[("autopilot", nonsense)] * 3).at(NOW).own
    np.testing.assert_allclose(known.position, [2.0, 1.0, 3.0], atol=1e-6)
    np.testing.assert_allclose(known.velocity, ZERO, atol=1e-6)


def origin_at(step, time):
    latitude = FLEET.latitude + step * 3e-5
    return AT_FLEET_ZERO._replace(latitude=latitude, time=time)


@LAWS
@given(
    late=st.lists(st.tuples(st.integers(0, 4), st.integers(0, 2_000_000)), max_size=8),
    boot=st.integers(1, 10**10),
)
def test_an_origin_from_before_that_comes_late_or_again_changes_nothing(late, boot):
    """One that came from the autopilot earlier by its own clock."""
    picture = world(*(("autopilot", origin_at(k, boot + k)) for k in range(6)))
    frame = picture.at(NOW).local
    for step, later in late:
        picture.receive(NOW + later, "autopilot", origin_at(step, boot + step))
        assert picture.at(NOW).local is frame


@LAWS
@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 2_000_000)), max_size=8))
def test_a_late_copy_of_an_earlier_origin_changes_nothing_though_none_has_a_time(late):
    picture = world(*(("autopilot", origin_at(k, 0)) for k in range(6)))
    frame = picture.at(NOW).local
    for step, later in late:
        picture.receive(NOW + later, "autopilot", origin_at(step, 0))
        assert picture.at(NOW).local is frame
    picture.receive(NOW + 2_000_001, "autopilot", origin_at(0, 0))
    assert picture.at(NOW).local is not frame


def test_an_origin_without_a_time_makes_no_earlier_stamp_new():
    picture = world(
        ("autopilot", origin_at(0, 7)), ("autopilot", origin_at(1, 9)), ("autopilot", origin_at(2, 0))
    )
    frame = picture.at(NOW).local
    picture.receive(NOW, "autopilot", origin_at(0, 7))
    assert picture.at(NOW).local is frame


@pytest.mark.parametrize("time", [0, 7])
def test_an_autopilot_that_began_anew_or_says_no_time_has_the_origin_that_it_says(time):
    picture = world(("autopilot", origin_at(1, 10**9)))
    later = NOW + (2_000_001 if time else 0)
    picture.receive(later, "autopilot", origin_at(2, time))
    expected = FLEET.local(*origin_at(2, time)[1:4])
    np.testing.assert_array_equal(
        picture.at(later).local.position_to_fleet(ZERO), expected.position_to_fleet(ZERO)
    )


def test_another_origin_is_no_other_clock():
    picture, now = world(("autopilot", AT_FLEET_ZERO)), NOW
    for boot in (10_000_000, 1_000_000):
        for k in range(80):
            now += 20_000
            received = local((1, 2, -3))._replace(time_boot=boot + 20_000 * k)
            picture.receive(now, "autopilot", received)
    assert picture.clock_steps == 1
    picture.receive(now, "autopilot", AT_FLEET_ZERO._replace(latitude=FLEET.latitude + 1e-7))
    assert picture.clock_steps == 1
    for k in range(80, 90):
        now += 20_000
        picture.receive(now, "autopilot", local((1, 2, -3))._replace(time_boot=1_000_000 + 20_000 * k))
        assert picture.clock_steps == 1


@pytest.mark.parametrize("origins", [1, 2, 3])
@pytest.mark.parametrize("shift", [3e-5, 1e-3])
def test_a_move_of_the_origin_is_noticed_however_many_come_before_a_position(origins, shift):
    picture = world(("autopilot", AT_FLEET_ZERO), ("autopilot", local((1, 2, -3))))
    was = picture.at(NOW).own.position
    for k in range(origins):
        latitude = FLEET.latitude + shift * (k + 1) / origins
        picture.receive(NOW + k, "autopilot", AT_FLEET_ZERO._replace(latitude=latitude))
    later = NOW + 20_000
    picture.receive(later, "autopilot", local((1, 2, -3)))
    moved = float(np.linalg.norm(picture.at(later).own.position - was))
    assert moved > 3.0
    assert (picture.moves, picture.displaced) == (1, pytest.approx(moved, abs=1e-6))


STALE = CONFIG.guard.own_stale_us


def test_a_heading_that_is_too_old_is_none():
    """As long as the own state may be: after that nobody knows where the vehicle looks."""
    picture = world(("autopilot", AT_FLEET_ZERO), ("autopilot", attitude(0.0)))
    received = NOW - CONFIG.own.delay_us
    assert picture.at(received + STALE).yaw == pytest.approx(math.pi / 2)
    assert picture.at(received + STALE + 1).yaw is None
    picture.receive(NOW + 10 * STALE, "autopilot", attitude(math.pi / 2))
    assert picture.at(NOW + 10 * STALE).yaw == pytest.approx(0.0, abs=1e-9)


@LAWS
@given(late=st.integers(0, 3 * STALE))
def test_a_heading_that_waited_is_as_old_as_its_stamp_says(late):
    """By the clock of the own positions."""
    picture = world(("autopilot", AT_FLEET_ZERO))
    for k in range(10):
        here = local((1, 2, -3))._replace(time_boot=10**7 + k * 20_000)
        picture.receive(NOW + k * 20_000, "autopilot", here)
    sent = 9 * 20_000
    picture.receive(NOW + sent + late, "autopilot", attitude(0.5)._replace(time_boot=10**7 + sent))
    known = picture.at(NOW + sent + late).yaw is not None
    assert known == (late + CONFIG.own.delay_us <= STALE)
