"""Who turns: carried along an arc, and how fast, learnt from velocities."""

from __future__ import annotations

from math import cos, hypot, inf, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.estimation import TrackConfig
from companion.estimation.tracks import Track
from companion.estimation.turn_rate import Turn, TurnFilter, turning_path

PERIOD = 200_000
START = 10_000_000
CONFIG = TrackConfig(
    sigma_position=0.1, sigma_velocity=0.1, sigma_acceleration=3.0, sigma_turn=0.5, stamps=False
)
STRAIGHT = CONFIG.model_copy(update={"sigma_turn": 0.0})
NOISY = TrackConfig(
    sigma_position=1.0, sigma_velocity=0.3, sigma_acceleration=1.0, sigma_turn=0.5, stamps=False
)

numbers = st.floats(-10.0, 10.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
rates = st.floats(-2.0, 2.0) | st.floats(-1e-7, 1e-7)
times = st.floats(0.0, 3.0)


@given(vectors, vectors, rates, times, times)
def test_an_arc_goes_on_where_it_was(x, v, rate, first, then):
    once = turning_path(x, v, rate, np.array([first]))
    twice = turning_path(once.positions[0], once.velocities[0], rate, np.array([then]))
    whole = turning_path(x, v, rate, np.array([first + then]))
    np.testing.assert_allclose(twice.positions, whole.positions, atol=1e-9)
    np.testing.assert_allclose(twice.velocities, whole.velocities, atol=1e-9)


@given(vectors, vectors, rates, times)
def test_the_velocity_is_what_the_position_does_and_its_size_stays(x, v, rate, time):
    step = 1e-4
    path = turning_path(x, v, rate, np.array([time - step, time, time + step]))
    seen = (path.positions[2] - path.positions[0]) / (2 * step)
    np.testing.assert_allclose(seen, path.velocities[1], atol=1e-5)
    speeds = np.hypot(path.velocities[:, 0], path.velocities[:, 1])
    np.testing.assert_allclose(speeds, hypot(v[0], v[1]), atol=1e-9)
    np.testing.assert_allclose(path.velocities[:, 2], v[2])


@given(vectors, vectors, times)
def test_who_does_not_turn_goes_straight(x, v, time):
    path = turning_path(x, v, 0.0, np.array([time]))
    np.testing.assert_allclose(path.positions[0], x + time * v, atol=1e-12)
    np.testing.assert_array_equal(path.velocities[0], v)


def circled(config, rate, speed, count=60, noise=None):
    """A track of somebody on a circle, its last time, and where it is then and 1.6 s later."""
    track, radius = Track(config), speed / rate
    random = np.random.default_rng(7)

    def place(t):
        return np.array([radius * sin(rate * t), -radius * cos(rate * t), 0.0])

    def velocity(t):
        return np.array([speed * cos(rate * t), speed * sin(rate * t), 0.0])

    for k in range(count):
        t = k * PERIOD * 1e-6
        x, v = place(t), velocity(t)
        if noise is not None:
            x, v = x + noise[0] * random.normal(size=3), v + noise[1] * random.normal(size=3)
        track.measure(START + k * PERIOD + config.delay_us, x, v)
    last = (count - 1) * PERIOD * 1e-6
    return track, START + (count - 1) * PERIOD, place(last + 1.6)


@pytest.mark.parametrize("rate", [-0.6, -0.33, 0.1, 0.33, 0.6])
@pytest.mark.parametrize("speed", [1.5, 4.0])
def test_a_turn_is_learnt_and_carried_on(rate, speed):
    track, now, there = circled(CONFIG, rate, speed)
    state = track.at(now)
    # It shrinks towards zero as far as the velocities are noise, which tells more at a walk.
    assert (0.95 if speed > 2.0 else 0.84) < state.turn_rate / rate < 1.01
    ahead = np.array([1.6])
    bent = np.linalg.norm(state.ahead(ahead).positions[0] - there)
    straight = np.linalg.norm(circled(STRAIGHT, rate, speed)[0].at(now).ahead(ahead).positions[0] - there)
    assert bent < 0.25 * straight
    # Also while nothing is heard: a second later it is still on its circle.
    later = track.at(now + 1_000_000).ahead(np.array([0.6])).positions[0]
    np.testing.assert_allclose(later, state.ahead(ahead).positions[0], atol=1e-9)


def test_noise_is_no_turn():
    """A straight walk with as noisy velocities as a phone's: hardly worse than if it could not turn."""
    errors = {}
    for name, config in (("bent", NOISY), ("straight", NOISY.model_copy(update={"sigma_turn": 0.0}))):
        random, track, found = np.random.default_rng(3), Track(config), []
        for k in range(400):
            x, v = np.array([1.5e-6 * k * PERIOD, 0.0, 0.0]), np.array([1.5, 0.0, 0.0])
            received = START + k * PERIOD + config.delay_us
            track.measure(received, x + random.normal(size=3), v + 0.3 * random.normal(size=3))
            there = x + 1.6 * v
            found.append(track.at(START + k * PERIOD).ahead(np.array([1.6])).positions[0] - there)
        errors[name] = float(np.sqrt(np.mean(np.square(found[50:]))))
    assert errors["bent"] < 1.1 * errors["straight"]


@given(st.lists(st.tuples(vectors, st.floats(0.0, 5.0)), max_size=20))
def test_what_is_known_is_finite_and_no_worse_than_nothing(steps):
    filter_ = TurnFilter(0.5, 3.0, 0.1)
    turn, before = filter_.prior, (0.0, 0.0)
    for velocity, dt in steps:
        now = (float(velocity[0]), float(velocity[1]))
        turn = filter_.updated(turn, dt, before, now)
        before = now
        assert abs(turn.rate) < inf
        assert 0.0 <= turn.variance <= filter_.prior.variance + 1e-12


def test_what_is_not_seen_any_more_is_forgotten():
    filter_ = TurnFilter(0.5, 3.0, 0.1)
    # It stands still: no course, no news.
    turn = filter_.updated(Turn(0.4, 0.01), 30.0, (0.0, 0.0), (0.0, 0.0))
    assert abs(turn.rate) < 1e-4
    assert turn.variance == pytest.approx(0.25, rel=1e-6)


def test_a_course_that_wraps_has_turned_a_little():
    filter_ = TurnFilter(0.5, 3.0, 0.01)
    before, now = pi - 0.05, pi + 0.05
    turn = filter_.updated(
        filter_.prior, 0.2, (4 * cos(before), 4 * sin(before)), (4 * cos(now), 4 * sin(now))
    )
    assert turn.rate == pytest.approx(0.5, rel=0.1)


def test_a_jump_leaves_no_turn_behind():
    track, now, _ = circled(CONFIG, 0.33, 4.0)
    assert track.at(now).turn_rate > 0.3
    for k in (1, 2):
        received = now + k * PERIOD + CONFIG.delay_us
        track.measure(received, np.array([500.0, 0.0, 0.0]), np.zeros(3))
    assert track.at(now + 2 * PERIOD).turn_rate == 0.0
