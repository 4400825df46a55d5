"""Rotors, ground and batches: laws of the whole vehicle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.vehicle.airframe import airframe, airframe_record
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import (
    NotFiniteError,
    Reference,
    Vehicle,
    advance_many,
    command_row,
    initial_states,
)
from sitl.vehicle.pipeline import LANDED

CONFIG = Path(__file__).parents[3] / "config" / "vehicles" / "firefly.yaml"
FIREFLY = VehicleConfig.model_validate(yaml.safe_load(CONFIG.read_text()))
REST = -FIREFLY.rest_height
HOVER = Reference.hover((0.0, 0.0, -3.0))


def test_rotors_follow_their_own_time_constants_exactly():
    vehicle = Vehicle(FIREFLY, (0.0, 0.0, 0.0))
    vehicle.advance(7, None, idle=True)
    expected = FIREFLY.omega_idle * -np.expm1(-7 * 0.0025 / FIREFLY.tau_up)
    np.testing.assert_allclose(vehicle.state.rotor_speeds, expected, rtol=1e-13)
    vehicle.advance(11, None)
    np.testing.assert_allclose(
        vehicle.state.rotor_speeds, expected * np.exp(-11 * 0.0025 / FIREFLY.tau_down), rtol=1e-13
    )
    vehicle.advance(400, None)
    assert np.all(vehicle.state.rotor_speeds == 0.0)


@pytest.mark.parametrize("idle", [False, True])
def test_landed_vehicle_stays_where_it_is_to_the_last_bit(idle):
    vehicle = Vehicle(FIREFLY, (3.3, -1.7, 0.0), yaw=0.4)
    assert vehicle.on_ground
    before = vehicle.state
    track = vehicle.advance(4000, None, wind=(8.0, 5.0, 0.0), idle=idle)
    assert np.all(track == [3.3, -1.7, REST])
    assert np.all(vehicle.state.attitude == before.attitude)
    assert np.all(vehicle.state.velocity == 0.0)
    assert vehicle.on_ground


@pytest.mark.parametrize("roll", [0.0, 0.5, -0.9])
def test_fallen_vehicle_never_sinks_in_and_comes_to_rest_flat(roll):
    states = initial_states(FIREFLY, [[0.0, 0.0, -2.0]], [0.0], 0.0)
    states[0, 3:6] = (2.0, -1.0, 0.0)
    states[0, 6:10] = (np.cos(roll / 2), np.sin(roll / 2), 0.0, 0.0)
    record, command = airframe_record(airframe(FIREFLY)), command_row(None)[None]
    track = advance_many(states, command, record, 1600)
    assert track[0, :, 2].max() <= REST
    assert states[0, 2] == REST
    resting = states.copy()
    advance_many(states, command, record, 400)
    np.testing.assert_array_equal(states[0, :10], resting[0, :10])
    assert abs(2.0 * np.arcsin(states[0, 7])) < 1e-6


def test_vehicle_lying_on_its_side_stays_so():
    states = initial_states(FIREFLY, [[0.0, 0.0, -1.0]], [0.0], 0.0)
    states[0, 6:10] = (np.cos(1.0), np.sin(1.0), 0.0, 0.0)
    advance_many(states, command_row(None)[None], airframe_record(airframe(FIREFLY)), 800)
    assert states[0, 7] == pytest.approx(np.sin(1.0), abs=1e-9)
    assert states[0, LANDED] == 1.0


def test_takes_off_hovers_and_lands():
    vehicle = Vehicle(FIREFLY, (0.0, 0.0, 0.0))
    vehicle.advance(40, None, idle=True)
    vehicle.advance(4000, HOVER)
    assert not vehicle.on_ground
    np.testing.assert_allclose(vehicle.state.position, HOVER.position, atol=1e-4)
    for i in range(400):
        vehicle.advance(8, Reference(np.array([0.0, 0.0, -3.0 + 0.01 * i]), np.array([0.0, 0.0, 0.5])))
    assert vehicle.on_ground
    vehicle.advance(400, None)
    np.testing.assert_allclose(vehicle.state.position, [0.0, 0.0, REST], atol=1e-3)


def test_hover_is_an_equilibrium():
    vehicle = Vehicle(FIREFLY, (0.0, 0.0, -3.0))
    vehicle.advance(6000, HOVER)
    state = vehicle.state
    hover_speed = np.sqrt(FIREFLY.mass * 9.80665 / (6 * FIREFLY.k_f))
    np.testing.assert_allclose(state.rotor_speeds, hover_speed, rtol=1e-5)
    np.testing.assert_allclose(state.velocity, 0.0, atol=1e-5)
    np.testing.assert_allclose(state.acceleration, 0.0, atol=1e-4)
    np.testing.assert_allclose(state.attitude, [1.0, 0.0, 0.0, 0.0], atol=1e-9)


def some_commands(count, rng):
    commands = []
    for k in range(count):
        p, v, a, j, s = rng.normal(0.0, [[5.0], [2.0], [1.0], [0.5], [0.5]], (5, 3))
        reference = None if k % 4 == 3 else Reference(p - [0, 0, 20], v, a, j, s, *rng.normal(0.0, 1.0, 2))
        commands.append(command_row(reference, idle=k % 8 == 3, wind=rng.normal(0.0, 3.0, 3), ground=0.1 * k))
    return np.array(commands)


@pytest.mark.parametrize("count", [2, 5, 9, 20])
def test_vehicle_in_a_batch_moves_as_alone_to_the_last_bit(count):
    rng = np.random.default_rng(count)
    record = airframe_record(airframe(FIREFLY))
    together = initial_states(FIREFLY, rng.normal(0.0, 5.0, (count, 3)), rng.normal(size=count), 0.0)
    together[0, -6] = 0.3  # its first rotor
    apart = [together[k : k + 1].copy() for k in range(count)]
    for _ in range(5):
        commands = some_commands(count, rng)
        track = advance_many(together, commands, record, 40)
        for k in range(count):
            np.testing.assert_array_equal(
                advance_many(apart[k], commands[k : k + 1], record, 40)[0], track[k]
            )
            np.testing.assert_array_equal(apart[k][0], together[k])


def test_one_long_advance_is_many_short_ones():
    reference = Reference(
        *np.random.default_rng(3).normal(0.0, [[3.0], [2.0], [1.0], [0.5], [0.5]], (5, 3)), 0.4, -0.7
    )
    long, short = Vehicle(FIREFLY, (0.0, 0.0, -5.0)), Vehicle(FIREFLY, (0.0, 0.0, -5.0))
    whole = long.advance(80, reference)
    parts = [short.advance(2, reference.ahead(5000 * i)) for i in range(40)]
    np.testing.assert_allclose(np.vstack(parts), whole, atol=1e-11)


@given(
    column=st.integers(0, 5),
    value=st.sampled_from([np.nan, np.inf, -np.inf]),
)
@settings(max_examples=20, deadline=None)
def test_what_is_not_finite_is_refused_and_moves_nothing(column, value):
    vehicle = Vehicle(FIREFLY, (0.0, 0.0, -5.0))
    vehicle.advance(10, HOVER)
    before = vehicle.state
    bad = np.array([0.0, 0.0, 0.0])
    bad[column % 3] = value
    arguments = (Reference(bad), np.zeros(3)) if column < 3 else (HOVER, bad)
    with pytest.raises(NotFiniteError, match="vehicle 0"):
        vehicle.advance(2, *arguments)
    for old, new in zip(before, vehicle.state, strict=True):
        np.testing.assert_array_equal(old, new)
    assert np.all(np.isfinite(vehicle.advance(2, HOVER)))


def mirrored(vector):
    return np.asarray(vector) * (1.0, -1.0, 1.0)


def failing(rotor, left, sign=1.0):
    """Positions and states of a flight in which a rotor fails, mirrored left to right for ``sign`` −1.

    Without the rolling moment of RotorS, which is along the velocity whichever way a rotor turns and so has
    no mirror image.
    """
    config = FIREFLY.model_copy(update={"rolling_moment": 0.0})
    mirror = (1.0, sign, 1.0)
    vehicle = Vehicle(config, np.array([1.0, 2.0, -20.0]) * mirror, yaw=0.3 * sign, hovering=True)
    reference = Reference(
        np.array([3.0, 0.5, -21.0]) * mirror, np.array([0.5, -1.0, 0.0]) * mirror, yaw=0.7 * sign
    )
    wind = np.array([2.0, -1.0, 0.5]) * mirror
    tracks = [vehicle.advance(80, reference, wind)]
    vehicle.fail_rotor(rotor, left)
    tracks.extend(vehicle.advance(40, reference, wind) for _ in range(10))
    return np.vstack(tracks), vehicle.state


def test_a_rotor_with_all_its_speed_left_changes_nothing_to_the_bit():
    (track, state), (other, other_state) = failing(0, 1.0), failing(4, 1.0)
    np.testing.assert_array_equal(track, other)
    for one, two in zip(state, other_state, strict=True):
        np.testing.assert_array_equal(one, two)
    assert np.abs(track - failing(4, 0.99)[0]).max() > 1e-3


@pytest.mark.parametrize("left", [0.0, 0.6])
def test_the_failure_of_the_rotor_opposite_is_the_mirror_image(left):
    """Rotors 0 and 5, 1 and 4, 2 and 3 lie left and right of each other and turn the other way."""
    for one, other in ((0, 5), (1, 4)):
        (track, state), (image, image_state) = failing(one, left), failing(other, left, -1.0)
        np.testing.assert_allclose(mirrored(image), track, atol=1e-7)
        np.testing.assert_allclose(image_state.body_rates * (-1.0, 1.0, -1.0), state.body_rates, atol=1e-6)
        np.testing.assert_allclose(image_state.rotor_speeds[::-1], state.rotor_speeds, atol=1e-4)


def test_a_failed_rotor_turns_at_its_part_of_the_motors_speed():
    vehicle = Vehicle(FIREFLY, (0.0, 0.0, 0.0))
    vehicle.fail_rotor(2, 0.25)
    vehicle.advance(400, None, idle=True)
    expected = FIREFLY.omega_idle * np.array([1.0, 1.0, 0.25, 1.0, 1.0, 1.0])
    np.testing.assert_allclose(vehicle.state.rotor_speeds, expected, rtol=1e-9)


@pytest.mark.parametrize("dead", range(6))
def test_with_one_dead_rotor_it_stays_up_and_in_place_but_spins(dead):
    vehicle = Vehicle(FIREFLY, HOVER.position, hovering=True)
    vehicle.fail_rotor(dead, 0.0)
    for _ in range(500):
        vehicle.advance(8, HOVER)
        assert np.linalg.norm(vehicle.state.position - HOVER.position) < 0.6
    assert np.linalg.norm(vehicle.state.position - HOVER.position) < 0.3
    assert abs(vehicle.state.body_rates[2]) > 1.0


@pytest.mark.parametrize("left", [0.0, 0.2])
def test_the_failure_of_all_rotors_is_a_fall_and_stays_finite(left):
    vehicle = Vehicle(FIREFLY, (0.0, 0.0, -30.0), hovering=True)
    for k in range(6):
        vehicle.fail_rotor(k, left)
    reference = Reference.hover((5.0, -3.0, -30.0), yaw=2.0)
    for _ in range(500):
        vehicle.advance(8, reference, (6.0, -2.0, 1.0))
        for value in vehicle.state:
            assert np.all(np.isfinite(value))
    assert vehicle.on_ground


@given(left=st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6), yaw=st.floats(-3.0, 3.0))
@settings(max_examples=25, deadline=None)
def test_whatever_fails_the_state_stays_finite(left, yaw):
    vehicle = Vehicle(FIREFLY, (0.0, 0.0, -60.0), hovering=True)
    for k in range(6):
        vehicle.fail_rotor(k, left[k])
    for i in range(40):
        vehicle.advance(40, Reference.hover((i % 7, -i % 5, -60.0 + i), yaw=yaw), (3.0, 3.0, 0.0))
        for value in vehicle.state:
            assert np.all(np.isfinite(value))


@pytest.mark.parametrize(
    ("index", "left", "error"),
    [(6, 0.5, IndexError), (-1, 0.5, IndexError), (0, 1.1, ValueError), (0, np.nan, ValueError)],
)
def test_an_impossible_failure_is_refused(index, left, error):
    vehicle = Vehicle(FIREFLY, (0.0, 0.0, 0.0))
    with pytest.raises(error, match="firefly"):
        vehicle.fail_rotor(index, left)
    np.testing.assert_array_equal(
        vehicle.advance(8, HOVER), Vehicle(FIREFLY, (0.0, 0.0, 0.0)).advance(8, HOVER)
    )


@pytest.mark.parametrize("yaw", [0.0, 2.1])
@pytest.mark.parametrize("gravity", [9.80665, 9.78])
def test_who_starts_in_the_air_hovers_there_at_once(yaw, gravity):
    vehicle = Vehicle(FIREFLY, (4.0, -2.0, -3.0), yaw, gravity=gravity, hovering=True)
    track = vehicle.advance(800, Reference.hover((4.0, -2.0, -3.0), yaw))
    assert np.linalg.norm(track - [4.0, -2.0, -3.0], axis=1).max() < 1e-3
    assert vehicle.yaw == pytest.approx(yaw, abs=1e-6)


def test_nobody_hovers_on_the_ground():
    with pytest.raises(ValueError, match="vehicle 1 cannot hover"):
        initial_states(FIREFLY, [[0.0, 0.0, -3.0], [0.0, 0.0, 0.0]], [0.0, 0.0], 0.0, hovering=True)


def test_a_quadrotor_flies_too():
    """Compiled anew for its number of rotors."""
    rotors = [{"angle_deg": 45.0 + 90.0 * i, "arm": 0.3, "spin": "ccw" if i % 2 else "cw"} for i in range(4)]
    config = VehicleConfig.model_validate({**FIREFLY.model_dump(), "rotors": rotors, "k_f": 1.4e-5})
    vehicle = Vehicle(config, (0.0, 0.0, -3.0), yaw=0.5)
    vehicle.advance(6000, Reference.hover((1.0, 0.5, -3.0), yaw=0.5))
    np.testing.assert_allclose(vehicle.state.position, [1.0, 0.5, -3.0], atol=1e-3)
    assert vehicle.state.rotor_speeds.shape == (4,)
