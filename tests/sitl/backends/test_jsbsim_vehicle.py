"""The JSBSim backend by itself: its wrench, its ground, its air, its silence, its errors."""

from __future__ import annotations

import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.frames import enu_to_ned
from sitl.backends.jsbsim_engine import Air, Engine
from sitl.backends.jsbsim_place import Place, euler_angles, rotation_of
from sitl.backends.jsbsim_vehicle import JsbsimVehicle
from sitl.backends.physics import BackendError
from sitl.backends.selection import Start, physics, severity
from sitl.environment.weather import WeatherConfig
from sitl.vehicle.multirotor import NotFiniteError, Reference, Vehicle, initial_states
from sitl.vehicle.pipeline import STATE_SIZE
from tests.sitl.jsbsim_pairs import CALM, HIGH, PERIOD, PLACE, SITE, VEHICLES, gravity, lap, vehicle

pytest.importorskip("jsbsim", reason="there is no wheel of JSBSim for this machine")

FIREFLY = vehicle("firefly")
BRISK = vehicle("firefly", 2_500)
POUND, FOOT = 4.4482216152605, 0.3048

both = pytest.mark.parametrize("name", VEHICLES)


def flying(config=FIREFLY, position=HIGH, yaw=0.3, **given):
    row = initial_states(config, position, [yaw], 0.0, hovering=True, gravity=gravity())[0]
    return JsbsimVehicle(config, PLACE, row, 0.0, **given)


def landed(config=FIREFLY, position=(3.0, -2.0, 0.0), yaw=0.3):
    return JsbsimVehicle(config, PLACE, initial_states(config, position, [yaw], 0.0)[0], 0.0)


# Motion and forces


@st.composite
def rows(draw):
    """A name and a state row of it, flying anyhow."""
    name = draw(st.sampled_from(VEHICLES))
    config = vehicle(name)
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    row = initial_states(config, rng.normal(0.0, 50.0, 3) - [0.0, 0.0, 300.0], [0.0], 0.0)[0]
    row[3:6] = rng.normal(0.0, 6.0, 3)
    attitude = rng.normal(size=4)
    row[6:10] = attitude / np.linalg.norm(attitude)
    row[10:13] = rng.normal(0.0, 2.0, 3)
    row[STATE_SIZE : STATE_SIZE + len(config.rotors)] = rng.uniform(100.0, 838.0, len(config.rotors))
    return name, row


@given(rows())
@settings(max_examples=40)
def test_it_begins_as_asked(given_row):
    name, row = given_row
    engine = JsbsimVehicle(vehicle(name), PLACE, row, 0.0)
    command = Reference.hover(row[0:3])
    period = 1e-6 * PERIOD
    engine.advance(1, command)
    state = engine.state
    np.testing.assert_allclose(state.position, row[0:3] + period * row[3:6], atol=1e-3)
    np.testing.assert_allclose(state.velocity, row[3:6], atol=0.3)
    # From one attitude to the other it turned as the body rates say.
    between = rotation_of(row[6:10]).T @ rotation_of(state.attitude)
    turned = np.array(
        [between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1]]
    )
    np.testing.assert_allclose(0.5 * turned / period, row[10:13], atol=2.0)


@given(rows(), st.lists(st.floats(-10.0, 10.0), min_size=3, max_size=3), st.floats(0.0, 1.0))
@settings(max_examples=40)
def test_the_wrench_is_that_of_the_rotor_model(given_row, wind, left):
    """From the definitions: thrust k_f ω², torque k_m of it, −c|ω|v⊥, v being that of each hub in the air."""
    name, row = given_row
    config = vehicle(name)
    engine = JsbsimVehicle(config, PLACE, row, 0.0)
    engine.fail_rotor(1, left)
    engine.advance(1, None, wind)
    state, measured = engine.state, engine.measured
    R = rotation_of(state.attitude)
    force, moment = np.zeros(3), np.zeros(3)
    for rotor, omega in zip(config.rotors, state.rotor_speeds, strict=True):
        arm = np.array(rotor.position)
        hub = R.T @ (state.velocity - wind) + np.cross(state.body_rates, arm)
        hub[2] = 0.0
        thrust = config.k_f * omega**2
        push = np.array([0.0, 0.0, -thrust]) - config.rotor_drag * omega * hub
        force += push
        moment += np.cross(arm, push) - config.rolling_moment * omega * hub
        moment[2] += (1.0 if rotor.spin == "ccw" else -1.0) * config.k_m * thrust
    np.testing.assert_allclose(POUND * measured[14:17], force, atol=1e-3)
    np.testing.assert_allclose(POUND * FOOT * measured[17:20], moment, atol=1e-4)


def test_the_motors_are_those_of_our_own_physics():
    own, jsbsim = Vehicle(BRISK, (3.0, -2.0, 0.0)), landed(BRISK)
    for steps, idle in ((7, True), (11, False)):
        own.advance(steps, None, idle=idle)
        jsbsim.advance(steps, None, idle=idle)
        np.testing.assert_allclose(jsbsim.state.rotor_speeds, own.state.rotor_speeds, rtol=1e-12)
    jsbsim.advance(400, None)
    assert np.all(jsbsim.state.rotor_speeds == 0.0)


@given(st.floats(-np.pi, np.pi), st.floats(-1.5, 1.5), st.floats(-np.pi, np.pi))
def test_euler_angles_are_those_of_the_rotation(roll, pitch, yaw):
    half = 0.5 * np.array((roll, pitch, yaw))
    (cr, cp, cy), (sr, sp, sy) = np.cos(half), np.sin(half)
    attitude = np.array(
        (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )
    )
    told = euler_angles(rotation_of(attitude))
    np.testing.assert_allclose(
        np.exp(1j * np.array(told)), np.exp(1j * np.array((roll, pitch, yaw))), atol=1e-6
    )


@given(st.floats(-3e3, 3e3), st.floats(-3e3, 3e3), st.floats(-500.0, 100.0))
@settings(max_examples=30)
def test_the_place_is_where_the_bridge_says(north, east, down):
    """Two ways from the site's NED to the Earth and back."""
    there = PLACE.geodetic((north, east, down))
    np.testing.assert_allclose(enu_to_ned(SITE.to_enu(*there)), (north, east, down), atol=1e-5)
    local = PLACE.local_axes(there)
    np.testing.assert_allclose(local @ local.T, np.eye(3), atol=1e-12)
    # Tangent planes are tilted by the angle that the way spans at the centre of the Earth.
    assert (
        np.degrees(np.arccos(min(1.0, local[2, 2])))
        < 1.02 * np.degrees(np.hypot(north, east) / 6.35e6) + 1e-6
    )


# The ground


@both
@pytest.mark.parametrize("period", [1_000, 2_500, 4_000, 10_000])
def test_it_stands_where_it_is_put_with_idling_rotors_in_the_wind(name, period):
    config = vehicle(name, period)
    standing = landed(config)
    track = standing.advance(4_000_000 // period, None, (8.0, 5.0, 0.0), idle=True)
    assert standing.on_ground
    np.testing.assert_allclose(track, np.tile([3.0, -2.0, -config.rest_height], (len(track), 1)), atol=1e-3)


@both
@pytest.mark.parametrize("roll", [0.0, 0.5, -0.9, 2.0, np.pi])
def test_who_falls_comes_to_rest_on_the_ground(name, roll):
    config = vehicle(name)
    row = initial_states(config, [0.0, 0.0, -2.0], [0.0], 0.0)[0]
    row[3:6] = (2.0, -1.0, 0.0)
    row[6:10] = (np.cos(roll / 2), np.sin(roll / 2), 0.0, 0.0)
    fallen = JsbsimVehicle(config, PLACE, row, 0.0)
    track = fallen.advance(2000, None)
    assert fallen.on_ground
    assert track[:, 2].max() < 0.1
    rest = fallen.state
    np.testing.assert_allclose(rest.velocity, 0.0, atol=1e-3)
    np.testing.assert_allclose(fallen.advance(250, None), np.tile(rest.position, (250, 1)), atol=1e-3)
    assert abs(rest.position[0]) < 2.0


def test_it_takes_off_from_the_ground():
    vehicle_ = landed(BRISK)
    vehicle_.advance(40, None, idle=True)
    assert vehicle_.on_ground
    vehicle_.advance(3000, Reference.hover((3.0, -2.0, -3.0), 0.3))
    assert not vehicle_.on_ground
    np.testing.assert_allclose(vehicle_.state.position, [3.0, -2.0, -3.0], atol=2e-3)


@pytest.mark.parametrize("position", [(800.0, -600.0, -0.06), (-2000.0, 1000.0, -0.06)])
def test_far_from_the_origin_the_ground_is_where_it_is_said(position):
    row = initial_states(FIREFLY, position, [0.3], 0.0)[0]
    standing = JsbsimVehicle(FIREFLY, PLACE, row, 0.0)
    track = standing.advance(500, None)
    np.testing.assert_allclose(track[-1], position, atol=1e-3)


# The air


def test_in_the_standard_atmosphere_thrust_falls_with_the_density():
    """ρ/ρ0 = (1 − 2.25577e-5 h)^4.25588, at 498 m: the rotors lift that much less."""
    heights = []
    for isa in (False, True):
        row = initial_states(FIREFLY, HIGH, [0.3], 0.0, hovering=True, gravity=gravity())[0]
        engine = Engine(FIREFLY, PLACE, row, 0.0, Air(isa=isa))
        heights.append(-POUND * engine.measured[16])
    assert heights[0] == pytest.approx(FIREFLY.mass * gravity(), rel=1e-9)
    assert heights[1] / heights[0] == pytest.approx((1.0 - 2.25577e-5 * 498.0) ** 4.25588, rel=1e-3)
    thin = flying(air=Air(isa=True))
    thin.advance(2500, Reference.hover(HIGH, 0.3))
    np.testing.assert_allclose(thin.state.position, HIGH, atol=0.01)
    assert np.all(thin.state.rotor_speeds > 1.01 * flying().state.rotor_speeds)


def gusts(seed, wind=(4.0, 0.0, 0.0), w20=7.717):
    vehicle_ = flying(air=Air(w20, severity(w20), seed))
    told = []
    for _ in range(1500):
        vehicle_.advance(1, Reference.hover(HIGH, 0.3), wind)
        told.append(vehicle_.air)
    return np.array(told), vehicle_.state


def test_jsbsims_turbulence_is_seeded_and_shakes_the_vehicle():
    (one, state), (again, same), (other, _) = gusts(7), gusts(7), gusts(8)
    np.testing.assert_array_equal(one, again)
    np.testing.assert_array_equal(state.position, same.position)
    assert np.abs(one - other).max() > 0.1
    assert np.all(one.std(axis=0) > 0.02)
    assert np.linalg.norm(state.velocity) > 1e-3


def test_without_turbulence_the_air_is_the_wind():
    told, _ = gusts(7, (3.0, -2.0, 0.5), 0.0)
    np.testing.assert_allclose(told, np.tile([3.0, -2.0, 0.5], (1500, 1)), atol=1e-12)


@pytest.mark.parametrize(("w20", "curve"), [(0.0, 0), (3.0, 3), (7.717, 3), (15.0, 4), (23.15, 6), (40.0, 6)])
def test_severities_are_the_curves_of_the_standard(w20, curve):
    assert severity(w20) == curve


START = Start(HIGH, 0.3, 0.0, hovering=True)


@pytest.mark.parametrize("setting", [{"turbulence_by": "jsbsim"}, {"atmosphere": "isa"}])
def test_our_own_physics_refuses_what_only_jsbsim_makes(setting):
    with pytest.raises(ValueError, match="needs physics: jsbsim"):
        physics("own", FIREFLY, START, SITE, WeatherConfig(**setting), 1, 11)
    physics("jsbsim", FIREFLY, START, SITE, WeatherConfig(**setting), 1, 11)


def test_every_vehicle_and_every_seed_has_its_own_turbulence():
    weather = WeatherConfig(wind=(4.0, 0.0, 0.0), turbulence="light", turbulence_by="jsbsim")
    winds = []
    for seed, system in ((1, 11), (1, 12), (2, 11), (1, 11)):
        flown = physics("jsbsim", FIREFLY, START, SITE, weather, seed, system)
        flown.advance(50, Reference.hover(HIGH, 0.3), (0.0, 4.0, 0.0))
        winds.append(flown.air)
    assert winds[0] == winds[3]
    assert len(set(winds)) == 3


# Determinism, silence, errors


def test_the_same_flight_twice_is_the_same_to_the_last_bit():
    tracks = []
    for _ in range(2):
        vehicle_ = flying()
        tracks.append([vehicle_.advance(2, lap(0.008 * k), (2.0, 1.0, 0.0)) for k in range(250)])
    np.testing.assert_array_equal(*tracks)


def test_it_says_nothing_and_leaves_the_environment_alone(capfd, monkeypatch):
    monkeypatch.setenv("JSBSIM_DEBUG", "3")
    falling = JsbsimVehicle(FIREFLY, PLACE, initial_states(FIREFLY, [0.0, 0.0, -1.0], [0.0], 0.0)[0], 0.0)
    falling.advance(500, None)
    assert falling.on_ground
    assert capfd.readouterr() == ("", "")
    assert os.environ["JSBSIM_DEBUG"] == "3"


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("which", ["reference", "wind"])
def test_what_is_not_finite_is_refused_and_moves_nothing(value, which):
    vehicle_ = flying()
    vehicle_.advance(10, Reference.hover(HIGH, 0.3))
    before = vehicle_.state
    bad = np.array((0.0, value, 0.0))
    arguments = (Reference.hover(bad), CALM) if which == "reference" else (Reference.hover(HIGH), bad)
    with pytest.raises(NotFiniteError, match="firefly"):
        vehicle_.advance(2, *arguments)
    for old, new in zip(before, vehicle_.state, strict=True):
        np.testing.assert_array_equal(old, new)
    assert np.all(np.isfinite(vehicle_.advance(2, Reference.hover(HIGH, 0.3))))


def test_a_vehicle_may_be_called_anything():
    config = FIREFLY.model_copy(update={"name": '../<a> & "b"'})
    assert flying(config).advance(5, Reference.hover(HIGH, 0.3)).shape == (5, 3)


def test_a_state_that_is_lost_in_jsbsim_does_not_pass_silently():
    row = initial_states(FIREFLY, HIGH, [0.3], 0.0, hovering=True)[0]
    row[3] = np.nan
    with pytest.raises(BackendError, match="firefly"):
        JsbsimVehicle(FIREFLY, PLACE, row, 0.0).advance(5, None)


@pytest.mark.parametrize(("index", "left", "error"), [(6, 0.5, IndexError), (0, 1.1, ValueError)])
def test_an_impossible_failure_is_refused(index, left, error):
    with pytest.raises(error, match="firefly"):
        flying().fail_rotor(index, left)


@pytest.mark.parametrize("latitude", [-33.9, 0.0, 69.6])
def test_it_flies_anywhere_on_the_earth(latitude):
    place = Place(type(SITE)(latitude, 151.2, 30.0))
    row = initial_states(FIREFLY, HIGH, [0.3], 0.0, hovering=True)[0]
    vehicle_ = JsbsimVehicle(FIREFLY, place, row, 0.0)
    goal = HIGH + np.array((2.0, 1.0, -1.0))
    vehicle_.advance(1500, Reference.hover(goal, 0.3))
    np.testing.assert_allclose(vehicle_.state.position, goal, atol=0.01)
