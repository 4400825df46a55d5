"""An autopilot flies on what it believes: the truth strays by what the estimate is off, and telemetry tells
the estimate."""

from __future__ import annotations

import numpy as np
import pytest

from mavlink_bridge.messages import Attitude, ExtendedSysState, GlobalPosition, Heartbeat, LocalPosition
from sitl.autopilot.firmware import Mode
from sitl.environment.weather import WeatherConfig
from sitl.node import Autopilot
from tests.sitl.autopilot_rig import ALL, FIREFLY, FLAVOURS, SITE, Rig, setpoint

PLACE = (2.0, -1.0, -5.0)
HERE = setpoint(ALL, PLACE)


def in_air(flavour="ardupilot", weather=None, seed=1, **settings):
    """Begins at PLACE's height over the origin."""
    rig = Rig(flavour, **{"start_height": 5.0, **settings})
    rig.autopilot = Autopilot(rig.config, FIREFLY, SITE, seed, weather)
    return rig


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize(("profile", "tube", "strays"), [("rtk", 0.09, 0.015), ("gnss", 0.25, 0.25)])
def test_the_truth_is_off_by_what_the_estimate_is_off(flavour, profile, tube, strays):
    rig = in_air(flavour, sensors=profile)
    rig.steer(6.0, HERE)
    errors, misses, places = [], [], []
    for k in range(4000):
        rig.step(*((HERE,) if k % 4 == 0 else ()))
        errors.append(rig.autopilot.estimate_error)
        misses.append(rig.position + errors[-1] - rig.autopilot.reference.position)
        places.append(rig.position)
    off = np.array(places) - PLACE
    assert np.abs(misses).max() < tube
    assert np.sqrt(np.mean(np.square(off))) > strays
    assert np.sqrt(np.mean(np.square(off + errors))) < 0.6 * np.sqrt(np.mean(np.square(errors))) + 0.01


def test_the_truth_profile_is_not_shifted():
    rig = in_air()
    rig.steer(8.0, HERE)
    assert rig.autopilot.estimate_error.tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_allclose(rig.position, PLACE, atol=2e-3)


def test_telemetry_tells_the_estimate():
    rig = in_air(sensors="gnss")
    rig.steer(1.0, HERE)
    told = 0
    for k in range(400):
        received = len(rig.received)
        rig.step(*((HERE,) if k % 4 == 0 else ()))
        believed = rig.autopilot.estimate
        for _, message in rig.received[received:]:
            if isinstance(message, LocalPosition):
                told += 1
                np.testing.assert_allclose(message.position_ned, believed.position, atol=1e-5)
                np.testing.assert_allclose(message.velocity_ned, believed.velocity, atol=1e-5)
                assert np.linalg.norm(believed.position - rig.position) > 0.1
            elif isinstance(message, GlobalPosition):
                place = SITE.to_enu(message.latitude, message.longitude, message.altitude)
                np.testing.assert_allclose(
                    place, (believed.position[1], believed.position[0], -believed.position[2]), atol=0.02
                )
            elif isinstance(message, Attitude):
                assert message.yaw == pytest.approx(believed.yaw, abs=1e-6)
                np.testing.assert_allclose(message.body_rates, believed.body_rates, atol=1e-6)
    assert told > 50


def test_positions_fail_to_come_now_and_then_and_attitudes_do_not():
    rig = in_air(sensors="gnss")
    rig.run(60.0)
    for kind, longest in ((LocalPosition, (0.1, 0.45)), (Attitude, (0.019, 0.021))):
        times = np.array([now for now, message in rig.received if isinstance(message, kind)]) * 1e-6
        assert longest[0] < np.diff(times).max() < longest[1]


@pytest.mark.parametrize("profile", ["truth", "gnss"])
def test_the_same_flight_twice_is_the_same_to_the_bit_and_asking_does_not_matter(profile):
    weather = WeatherConfig(wind=(2.0, 1.0, 0.0), turbulence="light")
    rigs = [in_air(sensors=profile, weather=weather) for _ in range(2)]
    for k in range(800):
        for rig in rigs:
            rig.step(*((HERE,) if k % 4 == 0 else ()))
        assert rigs[0].autopilot.estimate == rigs[0].autopilot.estimate
        assert rigs[0].autopilot.estimate_error.shape == (3,)
        assert np.array_equal(rigs[0].autopilot.trace, rigs[1].autopilot.trace)
    assert rigs[0].bytes == rigs[1].bytes


def test_seeds_make_different_flights():
    places = []
    for seed in (1, 2):
        rig = in_air(sensors="gnss", seed=seed)
        rig.run(1.0)
        places.append(rig.position)
    assert np.linalg.norm(places[1] - places[0]) > 1e-3


# Beginning in the air


@pytest.mark.parametrize("profile", ["truth", "gnss"])
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_it_begins_in_the_air_armed_and_stays(flavour, profile):
    rig = in_air(flavour, sensors=profile, start_height=7.0)
    rig.step()
    assert rig.autopilot.armed
    assert rig.autopilot.airborne
    assert rig.autopilot.mode is (Mode.GUIDED if flavour == "ardupilot" else Mode.HOLD)
    assert rig.all(Heartbeat)[0].base_mode & 0x80
    assert rig.all(ExtendedSysState)[0].landed_state == 2
    assert len(rig.all(LocalPosition)) == 1
    track = [rig.autopilot.trace]
    for _ in range(400):
        rig.step()
        track.append(rig.autopilot.trace)
    strayed = np.abs(np.concatenate(track) - (0.0, 0.0, -7.0)).max()
    assert strayed < (1e-6 if profile == "truth" else 0.4)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_in_the_air_set_points_are_accepted_at_once(flavour):
    rig = in_air(flavour)
    rig.step(HERE)
    if flavour == "px4":
        assert rig.guided() == [0]
    rig.run(8.0, HERE)
    np.testing.assert_allclose(rig.position, PLACE, atol=2e-3)
    assert rig.order(21) == [0]
    rig.run(12.0)
    assert not rig.autopilot.armed
    assert rig.position[2] == pytest.approx(0.0, abs=1e-6)


# A rotor


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_rotor_that_fails_disturbs_the_flight_and_what_is_left_of_it_matters(flavour):
    strayed = []
    for left in (1.0, 0.9, 0.0):
        rig = in_air(flavour)
        rig.steer(4.0, setpoint(ALL, (0.0, 0.0, -5.0)))
        rig.autopilot.fail_rotor(2, left)
        assert np.linalg.norm(rig.position - (0.0, 0.0, -5.0)) < 1e-3
        track = []
        for _ in range(300):
            rig.step()
            track.append(rig.position)
        strayed.append(np.linalg.norm(np.array(track) - (0.0, 0.0, -5.0), axis=1).max())
    assert strayed[0] < 1e-3 < strayed[1] < strayed[2]


@pytest.mark.parametrize(("index", "left"), [(6, 0.5), (-1, 0.5), (0, 1.1), (0, float("nan"))])
def test_there_is_no_other_rotor_and_none_is_better_than_sound(index, left):
    rig = in_air()
    with pytest.raises((IndexError, ValueError), match="rotor"):
        rig.autopilot.fail_rotor(index, left)


# Weather


def test_still_weather_is_no_weather():
    """To the bit."""
    rigs = [in_air(weather=weather) for weather in (None, WeatherConfig(), WeatherConfig(turbulence=0.0))]
    for rig in rigs:
        rig.steer(2.0, HERE)
        assert rig.autopilot.wind == (0.0, 0.0, 0.0)
    assert rigs[0].bytes == rigs[1].bytes == rigs[2].bytes
    assert np.array_equal(rigs[0].position, rigs[1].position)


def test_a_wind_makes_it_lean_into_it():
    rig = in_air(weather=WeatherConfig(wind=(6.0, 0.0, 0.0)))
    rig.steer(6.0, HERE)
    assert rig.autopilot.wind == (0.0, 6.0, -0.0)
    w, x, y, z = rig.autopilot.state.attitude
    # The body's downward axis points with the wind, so that thrust pushes against it.
    assert 2.0 * (y * z - w * x) > 0.02
    assert rig.speed < 0.05


def test_a_gust_comes_after_the_goal_event():
    gust = {"at_s": 1.0, "length_s": 2.0, "velocity": (8.0, 0.0, 0.0)}
    rig = in_air(weather=WeatherConfig(gusts=[gust]))
    rig.steer(8.0, HERE)
    assert rig.position[1] == pytest.approx(-1.0, abs=2e-3)
    rig.autopilot.begin(rig.now)
    blown = []
    for k in range(1200):
        rig.step(*((HERE,) if k % 4 == 0 else ()))
        blown.append((rig.autopilot.wind[1], rig.position[1]))
    winds, places = np.array(blown).T
    assert np.flatnonzero(winds)[[0, -1]] * 0.005 == pytest.approx([1.0, 3.0], abs=0.02)
    assert winds.max() == pytest.approx(8.0, abs=1e-3)
    assert places.max() > -0.98
    assert places[-1] == pytest.approx(-1.0, abs=0.02)
