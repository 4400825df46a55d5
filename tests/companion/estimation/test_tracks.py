"""Tracks: what is heard of one sender becomes a state with an age; noise is filtered, nonsense refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.estimation import TrackConfig
from companion.estimation.tracks import Track
from tests.companion.rig import LAWS, QUICK, numbers, vectors

CONFIG = TrackConfig()
START = 1_000_000_000
PERIOD = 100_000
PERIODS = st.integers(10_000, 300_000)


def followed(x, v, count=20, period=PERIOD, config=CONFIG):
    """A track of exact constant velocity: (track, when the last measurement was true)."""
    track = Track(config)
    for k in range(count):
        true = START + k * period
        assert track.measure(true + config.delay_us, x + v * k * period * 1e-6, v)
    return track, START + (count - 1) * period


@LAWS
@given(x=vectors(50.0), v=vectors(8.0), period=PERIODS, later=st.integers(0, 1_000_000))
def test_exact_motion_at_constant_velocity_is_recovered_with_the_delay_made_good(x, v, period, later):
    track, true = followed(x, v, period=period)
    state = track.at(true + later)
    np.testing.assert_allclose(state.position, x + v * (true + later - START) * 1e-6, atol=1e-6)
    np.testing.assert_allclose(state.velocity, v, atol=1e-6)
    assert state.age == later
    assert track.time == true
    assert track.rejected == 0


def test_nothing_heard_is_no_state():
    track = Track(CONFIG)
    assert track.at(START) is None
    assert track.time is None
    for ask in (lambda: track.last, track.covariance):
        with pytest.raises(ValueError, match="nothing has been heard"):
            ask()


@LAWS
@given(x=vectors(50.0), v=vectors(8.0), ages=st.lists(st.integers(0, 10**8), min_size=2, max_size=5))
def test_the_older_a_state_the_less_is_known_without_bound(x, v, ages):
    track, true = followed(x, v)
    sigmas = [track.at(true + age).sigma for age in sorted(ages)]
    assert sigmas == sorted(sigmas)
    for age, sigma in zip(sorted(ages), sigmas, strict=True):
        P = track.covariance(true + age)
        np.testing.assert_allclose(np.sqrt(np.diag(P)[:3]), sigma, rtol=1e-9)
    assert track.at(true + 10**9).sigma > 1e3


@pytest.mark.parametrize("up", [False, True])
def test_the_vertical_speed_has_the_sign_that_the_sender_is_said_to_give_it(up):
    track = Track(TrackConfig(velocity_up=up))
    track.measure(START, np.zeros(3), np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(track.at(START).velocity, [1.0, 2.0, -3.0 if up else 3.0])


def test_what_is_handed_out_is_the_callers_own():
    track, true = followed(np.zeros(3), np.ones(3))
    for now in (true, true + PERIOD):
        state = track.at(now)
        state.position[:], state.velocity[:] = 7.0, 7.0
    np.testing.assert_allclose(track.at(true).velocity, 1.0)
    np.testing.assert_allclose(track.last[3:], 1.0)


@LAWS
@given(x=vectors(50.0), v=vectors(8.0), beyond=st.integers(0, 10**10))
def test_extrapolation_ends_but_age_goes_on(x, v, beyond):
    track, true = followed(x, v)
    most = CONFIG.extrapolate_us
    state = track.at(true + most + beyond)
    np.testing.assert_array_equal(state.position, track.at(true + most).position)
    assert state.age == most + beyond


@LAWS
@given(
    x=vectors(50.0),
    v=vectors(8.0),
    direction=vectors(1.0).filter(lambda d: float(d @ d) > 0.01),
    distance=numbers(4.0, 1e4),
)
def test_one_teleport_is_noise_and_a_second_witness_makes_it_real(x, v, direction, distance):
    track, true = followed(x, v)
    jump = distance * direction / np.linalg.norm(direction)
    arrival = true + PERIOD + CONFIG.delay_us
    here = track.at(true + PERIOD).position
    assert not track.measure(arrival, here + jump, v)
    np.testing.assert_allclose(track.at(true + PERIOD).position, here)
    assert track.rejected == 1
    # Back on course: the teleport is forgotten, and the next one is again alone.
    again = track.at(true + 2 * PERIOD).position
    assert track.measure(arrival + PERIOD, again, v)
    assert not track.measure(arrival + 2 * PERIOD, again + v * PERIOD * 1e-6 + jump, v)
    # It persists: believed.
    there = again + 2 * v * PERIOD * 1e-6 + jump
    assert track.measure(arrival + 3 * PERIOD, there, v)
    state = track.at(arrival + 3 * PERIOD - CONFIG.delay_us)
    np.testing.assert_allclose(state.position, there)
    assert state.age == 0


@LAWS
@given(x=vectors(50.0), v=vectors(8.0), spike=vectors(90.0).filter(lambda d: float(d @ d) > 16.0))
def test_a_spike_of_velocity_is_noise_too(x, v, spike):
    """A position that fits with a velocity that does not: believed, it would carry the track far away."""
    track, true = followed(x, v)
    here = track.at(true + PERIOD).position
    assert not track.measure(true + PERIOD + CONFIG.delay_us, here, v + spike)
    np.testing.assert_array_equal(track.at(true + PERIOD).position, here)
    assert track.measure(true + 2 * PERIOD + CONFIG.delay_us, here + v * PERIOD * 1e-6, v)


@pytest.mark.parametrize("number", [1e6, 1e30, 3e38, np.inf, -np.inf, np.nan])
@pytest.mark.parametrize("part", ["position", "velocity"])
def test_what_no_vehicle_can_have_is_never_taken_however_often_it_comes(number, part):
    absurd = {"position": np.zeros(3), "velocity": np.zeros(3)}
    absurd[part] = np.array([0.0, number, 0.0])
    track = Track(CONFIG)
    for k in range(5):
        assert not track.measure(START + k * PERIOD, **absurd)
    assert track.at(START) is None
    track, true = followed(np.zeros(3), np.zeros(3))
    for k in range(5):
        assert not track.measure(true + k * PERIOD, **absurd)
    np.testing.assert_allclose(track.at(true + 5 * PERIOD).position, 0.0, atol=1e-9)


@LAWS
@given(x=vectors(10.0), data=st.data())
def test_teleports_that_do_not_agree_are_no_witnesses(x, data):
    track, true = followed(x, np.zeros(3))
    for k in range(6):
        # Every one further than the gate from all others.
        far = x + np.array([10.0 + 10.0 * k, 0.0, 0.0])
        assert not track.measure(true + (k + 1) * PERIOD + CONFIG.delay_us, far, np.zeros(3))
    np.testing.assert_allclose(track.at(true).position, x, atol=1e-6)


@LAWS
@given(x=vectors(50.0), v=vectors(8.0), late=st.integers(1, 10**7), wrong=vectors(50.0))
def test_what_is_older_than_the_track_remembers_is_refused_and_changes_nothing(x, v, late, wrong):
    track, true = followed(x, v)
    before = track.at(true)
    assert not track.measure(true + CONFIG.delay_us - CONFIG.rewind_us - late, wrong, v)
    after = track.at(true)
    np.testing.assert_array_equal(after.position, before.position)
    assert after[2:] == before[2:]
    assert track.rejected == 1


@QUICK
@given(
    seed=st.integers(0, 2**32 - 1),
    periods=st.lists(st.integers(0, 400_000), min_size=5, max_size=60),
    sigma=numbers(0.01, 2.0),
)
def test_the_covariance_stays_symmetric_and_positive_definite(seed, periods, sigma):
    random = np.random.default_rng(seed)
    track = Track(TrackConfig(sigma_position=sigma, jump=1e3))
    time = START
    for period in periods:
        time += period
        track.measure(time, random.normal(size=3) * sigma, random.normal(size=3))
        P = track.covariance()
        np.testing.assert_allclose(P, P.T, atol=1e-12 * np.abs(P).max())
        assert np.linalg.eigvalsh(P).min() > 0.0


def test_noise_is_filtered():
    """5 m/s at 10 Hz with the noise that the track was told of: better than the measurements themselves."""
    random = np.random.default_rng(1)
    config = TrackConfig(sigma_position=0.5, sigma_velocity=0.1, sigma_acceleration=0.5)
    track = Track(config)
    v, errors, raw = np.array([5.0, -1.0, 0.5]), [], []
    for k in range(300):
        true = START + k * PERIOD
        x = v * k * PERIOD * 1e-6
        noise = 0.5 * random.normal(size=3)
        track.measure(true + config.delay_us, x + noise, v + 0.1 * random.normal(size=3))
        if k > 20:
            errors.append(np.linalg.norm(track.at(true).position - x))
            raw.append(np.linalg.norm(noise))
    assert np.mean(errors) < 0.4 * np.mean(raw)


@LAWS
@given(x=vectors(50.0), v=vectors(8.0), shift=st.integers(-(10**8), 10**14))
def test_only_differences_of_time_matter(x, v, shift):
    tracks = Track(CONFIG), Track(CONFIG)
    for k in range(5):
        for track, offset in zip(tracks, (0, shift), strict=True):
            track.measure(START + offset + k * PERIOD, x + v * k * PERIOD * 1e-6, v)
    now = START + 5 * PERIOD
    one, other = tracks[0].at(now), tracks[1].at(now + shift)
    np.testing.assert_array_equal(one.position, other.position)
    assert one.age == other.age


@pytest.mark.parametrize("repeats", [1, 5])
def test_what_arrives_twice_at_once_does_no_harm(repeats):
    """A duplicated datagram: the state stays, nothing raises."""
    track, true = followed(np.zeros(3), np.array([3.0, 0.0, 0.0]))
    before = track.at(true).position
    for _ in range(repeats):
        assert track.measure(true + CONFIG.delay_us, before, np.array([3.0, 0.0, 0.0]))
    np.testing.assert_allclose(track.at(true).position, before, atol=1e-9)
