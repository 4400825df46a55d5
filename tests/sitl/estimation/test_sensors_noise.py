"""The random errors of an estimate: their sizes, how long they last, and that asking does not change them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from benchmarks.recorded_swarms import at_times, read_swarm
from sitl.environment.noise import one_pole, two_poles
from sitl.estimation.profiles import PROFILES, SensorProfile
from sitl.estimation.random_errors import PERIOD, RandomErrors

FLIGHTS = Path(__file__).parents[2] / "data" / "flights"
SHARES = st.floats(1e-4, 20.0)
NOISY = [PROFILES["rtk"], PROFILES["gnss"]]
SECOND = 1_000_000 // PERIOD


def matrices(first, second):
    p = two_poles(first, second)
    return np.array([[p.f11, p.f12], [p.f21, p.f22]]), np.array([[p.g11, 0.0], [p.g21, p.g22]])


@given(first=SHARES, second=SHARES)
def test_a_step_keeps_the_variance(first, second):
    keep, gain = one_pole(first)
    assert keep**2 + gain**2 == pytest.approx(1.0, abs=1e-12)
    F, G = matrices(first, second)
    np.testing.assert_allclose(F @ F.T + G @ G.T, np.eye(2), atol=1e-10)


@given(first=SHARES, second=SHARES)
def test_two_half_steps_are_one(first, second):
    assert one_pole(first / 2).keep ** 2 == pytest.approx(one_pole(first).keep, rel=1e-12)
    half, whole = matrices(first / 2, second / 2)[0], matrices(first, second)[0]
    np.testing.assert_allclose(half @ half, whole, atol=1e-12)


@given(share=SHARES)
def test_equal_poles_are_the_limit_of_unequal_ones(share):
    for equal, near in zip(matrices(share, share), matrices(share, share * (1.0 + 1e-9)), strict=True):
        np.testing.assert_allclose(equal, near, atol=1e-6)


def records(profile, seconds, seeds, every=SECOND // 10):
    """Errors (seeds, n, 12), ten a second."""
    found = []
    for seed in range(seeds):
        random_errors = RandomErrors(profile, np.random.default_rng(seed))
        rows = []
        for sample in range(0, seconds * SECOND, every):
            random_errors.advance(sample)
            e = random_errors.errors
            rows.append((*e.position, *e.velocity, e.roll, e.pitch, e.yaw, *e.body_rates))
        found.append(rows)
    return np.array(found)


@pytest.mark.parametrize("profile", NOISY, ids=["rtk", "gnss"])
def test_the_sizes_are_those_of_the_table(profile):
    """At two times, over 400 vehicles: three standard errors of σ are at most 11 %."""
    wanderings = [RandomErrors(profile, np.random.default_rng(seed)) for seed in range(400)]
    rows = []
    for sample in (0, 2 * SECOND):
        for random_errors in wanderings:
            random_errors.advance(sample)
            e = random_errors.errors
            rows.append((*e.position, *e.velocity, e.roll, e.pitch, e.yaw, *e.body_rates))
    p = profile
    drifting = p.drift_time * p.drift_onset
    flat, steep = p.horizontal_drift, p.vertical_drift
    position = [math.hypot(flat, p.position_white)] * 2 + [math.hypot(steep, p.position_white)]
    velocity = [math.hypot(drift / math.sqrt(drifting), p.velocity) for drift in (flat, flat, steep)]
    rates = [math.hypot(p.rate_bias, p.rate_white)] * 3
    np.testing.assert_allclose(
        np.std(rows, axis=0), [*position, *velocity, p.tilt, p.tilt, p.yaw, *rates], rtol=0.12
    )
    np.testing.assert_allclose(np.mean(rows, axis=0) / np.std(rows, axis=0), 0.0, atol=0.15)


def test_position_and_yaw_wander_as_slowly_as_the_table_says():
    """Correlation over one time constant; two poles keep a little more than e⁻¹ of it."""
    quick = {"drift_time": 8.0, "drift_onset": 1.0, "position_white": 0.0, "yaw_time": 8.0}
    rows = records(PROFILES["gnss"].model_copy(update=quick), 100, 20)
    for column, expected in ((0, (8 * math.exp(-1) - math.exp(-8)) / 7), (8, math.exp(-1))):
        row = rows[:, :, column] / rows[:, :, column].std()
        assert np.mean(row[:, :-80] * row[:, 80:]) == pytest.approx(expected, abs=0.15)


def test_the_velocity_says_where_the_position_goes():
    """The integral of the velocity error over 5 s and the change of the position error go together."""
    rows = records(PROFILES["gnss"], 50, 30, every=1)
    change = rows[:, 500::500, :2] - rows[:, :-500:500, :2]
    speeds = np.add.reduceat(rows[:, :, 3:5], np.arange(0, rows.shape[1], 500), axis=1)
    walked = speeds[:, :-1] * PERIOD * 1e-6
    assert np.corrcoef(change.ravel(), walked.ravel())[0, 1] > 0.85
    assert np.std(change - walked) < 0.7 * np.std(change)


def test_a_simulations_position_moves_by_its_velocity_and_the_drift():
    """The position controller is told what the velocity does not say: the pull of the filter."""
    random_errors, rows = RandomErrors(PROFILES["sih"], np.random.default_rng(3)), []
    for sample in range(60 * SECOND):
        random_errors.advance(sample)
        e = random_errors.errors
        rows.append((*e.position, *e.velocity, *e.drift))
    place, velocity, drift = np.split(np.array(rows), 3, axis=1)
    moved = np.diff(place[::SECOND], axis=0)
    said, unsaid = (
        np.add.reduceat(rate, np.arange(0, len(rate), SECOND), axis=0)[:-1] / SECOND
        for rate in (velocity, drift)
    )
    assert np.corrcoef(moved.ravel(), (said + unsaid).ravel())[0, 1] > 0.95
    assert np.corrcoef(velocity.ravel(), drift.ravel())[0, 1] < -0.7


def test_a_simulations_errors_are_those_of_recorded_flights():
    """Five PX4s in SIH: position and velocity are wrong together, both for seconds."""
    ratios = []
    recorded = [v for name in ("mixed-3-2", "px4-3-certified") for v in read_swarm(FLIGHTS / f"{name}.npz")]
    flown = [vehicle for vehicle in recorded if vehicle.flavour == "px4"]
    ours = long_errors(PROFILES["sih"])
    for vehicle in flown:
        times = np.arange(vehicle.truth[0, 0] + 1.0, vehicle.truth[-1, 0] - 1.0, 0.05)
        off = at_times(vehicle.estimate, times) - at_times(vehicle.truth, times)
        ratios.append(ours.std(axis=0) / off.std(axis=0))
        assert np.all(correlations(off) > 0.7)
    assert np.all(correlations(ours) > 0.7)
    assert len(flown) == 5
    # Errors at least as large as recorded, and at most twice.
    assert 1.0 <= np.min(np.mean(ratios, axis=0)) <= np.max(np.mean(ratios, axis=0)) <= 2.0


def long_errors(profile: SensorProfile) -> npt.NDArray[np.float64]:
    """Position and velocity errors (n, 6) of a quarter of an hour, every 0.05 s."""
    random_errors, rows = RandomErrors(profile, np.random.default_rng(1)), []
    for sample in range(0, 900 * SECOND, SECOND // 20):
        random_errors.advance(sample)
        rows.append((*random_errors.errors.position, *random_errors.errors.velocity))
    return np.array(rows)


def correlations(errors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Correlation of the errors (n, 6) of position and velocity on each axis."""
    return np.array([np.corrcoef(errors[:, axis], errors[:, axis + 3])[0, 1] for axis in range(3)])


@given(stops=st.lists(st.integers(0, 700), min_size=1, max_size=10))
def test_the_errors_do_not_depend_on_which_samples_are_looked_at(stops):
    profile = PROFILES["gnss"]
    hasty, patient = (RandomErrors(profile, np.random.default_rng(7)) for _ in range(2))
    for sample in range(max(stops) + 1):
        patient.advance(sample)
        if sample in stops:
            hasty.advance(sample)
            assert hasty.errors == patient.errors == patient.errors


def test_only_the_truth_is_exact():
    assert PROFILES["truth"].exact
    assert not any(profile.exact for profile in NOISY)
    assert not SensorProfile(delay=4).exact
    assert SensorProfile(gaps_per_minute=1.0).exact


@pytest.mark.parametrize("bad", [{"tilt": -1.0}, {"drift_time": 0.0}, {"yaw": math.inf}, {"jaw": 1.0}])
def test_what_is_no_profile_is_refused(bad):
    with pytest.raises(ValidationError):
        SensorProfile(**bad)
