"""The gate and the filter behind it: what is true passes, what is not is refused, nobody is locked out."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import KalmanFilter
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from companion.config import CompanionConfig
from companion.config.estimation import TrackConfig
from companion.estimation.estimator import Estimator
from companion.estimation.kalman_gains import Noise, _inverse, gain, model
from companion.estimation.tracks import Track
from tests.companion.rig import LAWS, QUICK, numbers, vectors

PERIOD = 100_000
START = 1_000_000_000


@LAWS
@given(elapsed=st.integers(1, 10_000_000), sigma=numbers(0.01, 20.0))
def test_the_model_is_filterpys(elapsed, sigma):
    F, Q = model(elapsed, sigma)
    dt = elapsed * 1e-6
    np.testing.assert_allclose(Q, Q_continuous_white_noise(2, dt, sigma**2), rtol=1e-9)
    np.testing.assert_array_equal(F, [[1.0, dt], [0.0, 1.0]])


@LAWS
@given(
    noise=st.builds(Noise, numbers(0.01, 3.0), numbers(0.01, 3.0) | st.just(1e4), numbers(0.1, 10.0)),
    elapsed=st.lists(st.integers(0, 10_000_000), min_size=1, max_size=10),
)
def test_gains_and_covariances_are_the_bits_of_filterpy(noise, elapsed):
    theirs = KalmanFilter(dim_x=2, dim_z=2)
    theirs.x, theirs.H = np.zeros(2), np.eye(2)
    theirs.R = np.diag([noise.position**2, noise.velocity**2])
    theirs.inv = _inverse
    theirs.P = theirs.R
    P = tuple(theirs.P.ravel().tolist())
    for step in elapsed:
        if step:
            F, Q = model(step, noise.acceleration)
            theirs.predict(F=F, Q=Q)
        theirs.update(np.zeros(2))
        ours = gain(noise, P, step)
        assert tuple(theirs.K.ravel().tolist()) == ours.K
        assert tuple(theirs.P.ravel().tolist()) == ours.P
        assert (theirs.S[0, 0], theirs.S[0, 1], theirs.S[1, 1]) == ours.S
        P = ours.P


@QUICK
@given(
    seed=st.integers(0, 2**32 - 1),
    elapsed=st.lists(st.integers(0, 500_000), min_size=1, max_size=30),
    sigma=numbers(0.05, 3.0),
)
def test_one_gain_for_three_axes_is_the_filter_of_six(seed, elapsed, sigma):
    random = np.random.default_rng(seed)
    config = TrackConfig(sigma_position=sigma, jump=1e4, gate=1e4)
    estimator = Estimator(config)
    full = KalmanFilter(dim_x=6, dim_z=6)
    full.H = np.eye(6)
    full.R = np.diag([config.sigma_position**2] * 3 + [config.sigma_velocity**2] * 3)
    z = random.normal(size=6)
    belief, time = estimator.after(None, 0, tuple(z.tolist())), 0
    full.x, full.P = z, full.R.copy()
    for step in elapsed:
        time += step
        z = random.normal(size=6)
        F, Q = model(step, config.sigma_acceleration)
        if step:
            full.predict(F=np.kron(F, np.eye(3)), Q=np.kron(Q, np.eye(3)))
        full.update(z)
        belief = estimator.after(belief, time, tuple(z.tolist()))
        np.testing.assert_allclose(belief.x, full.x, atol=1e-9)
        np.testing.assert_allclose(np.kron(np.reshape(belief.P, (2, 2)), np.eye(3)), full.P, atol=1e-9)


@pytest.mark.parametrize("passes", [0.99, 0.999])
def test_the_gate_refuses_as_many_true_measurements_as_it_says(passes):
    """A vehicle that moves as the model has it: the refused share is that of χ² with six degrees."""
    config = TrackConfig(
        sigma_position=0.3, sigma_velocity=0.2, gate=float(chi2.ppf(passes, 6)), witnesses=10, jump=1e3
    )
    random = np.random.default_rng(7)
    F, Q = model(PERIOD, config.sigma_acceleration)
    root = np.linalg.cholesky(Q)
    refused = count = 0
    for _ in range(20):
        x = np.zeros((2, 3))
        track = Track(config)
        for k in range(250):
            z = x + np.array([[0.3], [0.2]]) * random.normal(size=(2, 3))
            track.measure(START + k * PERIOD, *z)
            x = F @ x + root @ random.normal(size=(2, 3))
        count += 249
        refused += track.rejected
    expected = (1.0 - passes) * count
    assert abs(refused - expected) < 4.0 * np.sqrt(expected) + 1.0


def test_the_default_gate_is_the_quantile_that_it_is_said_to_be():
    assert chi2.cdf(TrackConfig().gate, 6) == pytest.approx(0.999, abs=1e-4)


@LAWS
@given(x=vectors(50.0), v=vectors(5.0), direction=vectors(1.0).filter(lambda d: float(d @ d) > 0.01))
def test_half_a_metre_is_a_teleport_for_one_who_knows_to_a_few_centimetres(x, v, direction):
    """Far below ``jump``: it is the covariance that tells."""
    track = Track(TrackConfig())
    for k in range(20):
        assert track.measure(START + k * PERIOD, x + v * k * PERIOD * 1e-6, v)
    off = 0.5 * direction / np.linalg.norm(direction)
    assert not track.measure(START + 20 * PERIOD, x + v * 20 * PERIOD * 1e-6 + off, v)
    assert track.measure(START + 21 * PERIOD, x + v * 21 * PERIOD * 1e-6, v)
    assert track.rejected == 1


def test_where_the_model_would_allow_anything_the_jump_is_what_counts():
    """The own state may accelerate as it likes: 5 m/s more within 20 ms pass χ², but not ``jump``."""
    config = CompanionConfig().own
    for jump, passes in ((config.jump, False), (10.0, True)):
        track = Track(config.model_copy(update={"jump": jump}))
        for k in range(20):
            assert track.measure(START + k * 20_000, np.zeros(3), np.zeros(3))
        assert track.measure(START + 400_000, np.zeros(3), np.array([5.0, 0.0, 0.0])) == passes


def test_measurements_that_contradict_each_other_do_not_add_up():
    """Two pairs of refused measurements, each of which agrees only in itself, are not three witnesses."""
    track = Track(TrackConfig(witnesses=3))
    for k in range(10):
        track.measure(START + k * PERIOD, np.zeros(3), np.zeros(3))
    for k, x in enumerate((50.0, 50.0, -80.0, -80.0), 10):
        assert not track.measure(START + k * PERIOD, np.array([x, 0.0, 0.0]), np.zeros(3))
    assert track.measure(START + 14 * PERIOD, np.array([-80.0, 0.0, 0.0]), np.zeros(3))


@pytest.mark.parametrize("witnesses", [1, 2, 3, 5])
def test_a_jump_that_persists_is_believed_with_as_many_witnesses_as_are_set(witnesses):
    track = Track(TrackConfig(witnesses=witnesses))
    for k in range(10):
        track.measure(START + k * PERIOD, np.zeros(3), np.zeros(3))
    there = np.array([16.0, 0.0, 0.0])
    verdicts = [track.measure(START + k * PERIOD, there, np.zeros(3)) for k in range(10, 20)]
    assert verdicts.index(True) == witnesses - 1
    assert all(verdicts[witnesses - 1 :])
    np.testing.assert_allclose(track.last[:3], there, atol=1e-9)


@pytest.mark.parametrize("rate", [50, 10, 5, 2, 1])
@pytest.mark.parametrize("acceleration", [2.0, 4.0, 8.0])
def test_a_manoeuvring_vehicle_is_never_locked_out(rate, acceleration):
    """Turning hard at 5 m/s, then reversing at once: what is refused is few, and the track is soon with it
    again."""
    period = 1_000_000 // rate
    worst, refused, count = 0, 0, 0
    for seed in range(3):
        random = np.random.default_rng(seed)
        track = Track(TrackConfig())
        x, v, side = np.zeros(3), np.array([5.0, 0.0, 0.0]), 1.0
        for k in range(15 * rate):
            now = START + k * period
            z = x + 0.02 * random.normal(size=3), v + 0.05 * random.normal(size=3)
            track.measure(now + 20_000, *z, 1_000_000 + k * period)
            worst = max(worst, track.at(now).age)
            count += 1
            if random.random() < 0.5 / rate:
                side = -side
            if random.random() < 0.1 / rate:
                v = -v
            # A circle, exactly.
            dt, turn = period * 1e-6, side * acceleration / 5.0
            across = np.array([-v[1], v[0], 0.0])
            sine, cosine = np.sin(turn * dt), np.cos(turn * dt)
            x = x + (sine * v + (1.0 - cosine) * across) / turn
            v = cosine * v + sine * across
        refused += track.rejected
    assert worst <= 2 * period
    assert refused <= 0.5 * count if rate <= 2 else refused <= 0.1 * count


@QUICK
@given(seed=st.integers(0, 2**32 - 1), factor=numbers(1.0, 20.0))
def test_noise_far_beyond_what_was_told_does_not_silence_a_sender(seed, factor):
    """Told 2 cm and seeing decimetres: the track is noisy, but it is there."""
    random = np.random.default_rng(seed)
    track = Track(TrackConfig())
    silence = []
    for k in range(200):
        now = START + k * PERIOD
        noise = factor * np.array([[0.02], [0.05]]) * random.normal(size=(2, 3))
        track.measure(now + 20_000, *noise, 1_000_000 + k * PERIOD)
        silence.append(track.at(now).age)
    assert np.mean(np.array(silence) > 1_000_000) < 0.2
    assert np.linalg.norm(track.last[:3]) < 6.0 * 0.02 * factor + 0.1
