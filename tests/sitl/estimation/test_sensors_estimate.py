"""From the truth to the estimate: late, wrong, with gaps; what it is off by; and what GPS does to it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.autopilot.course import believed
from sitl.estimation.gps_faults import Positioning
from sitl.estimation.profiles import PROFILES, SensorProfile
from sitl.estimation.sensors import Deviation, Sensors
from sitl.values.origin import Origin
from sitl.vehicle.multirotor import Reference, Vehicle
from tests.sitl.autopilot_rig import FIREFLY, SITE

ORIGIN = Origin(SITE, 47.41, 8.53, 500.0)
TICK = 5_000
DT = 0.01
REST = Vehicle(FIREFLY, (0.0, 0.0, -6.0)).state
START, VELOCITY = np.array([10.0, -4.0, -6.0]), np.array([3.0, -2.0, 0.5])
ANGLES = st.floats(-0.02, 0.02)


def state(time, yaw=0.3, tilt=0.1):
    """On a straight line, with one attitude."""
    cy, sy, cr, sr = math.cos(yaw / 2), math.sin(yaw / 2), math.cos(tilt / 2), math.sin(tilt / 2)
    attitude = np.array([cy * cr, cy * sr, sy * sr, sy * cr])
    rates, place = np.array([0.1, -0.2, 0.3]), START + VELOCITY * time * 1e-6
    return REST._replace(position=place, velocity=VELOCITY, attitude=attitude, body_rates=rates)


def sensors(profile, seed=1, system_id=11):
    return Sensors(profile, ORIGIN, state(0), 7.0, seed, system_id)


def moved(profile, until=1_000_000, tick=TICK, **who):
    made = sensors(profile, **who)
    for time in range(tick, until + 1, tick):
        made.advance(time, state(time))
    return made


def test_the_truth_is_believed():
    estimate = sensors(PROFILES["truth"]).estimate(state(0))
    np.testing.assert_allclose(ORIGIN.motion_to_site([estimate.position])[0], START, atol=1e-9)
    np.testing.assert_allclose(ORIGIN.vectors_to_site([estimate.velocity])[0], VELOCITY, atol=1e-12)
    assert estimate.roll == pytest.approx(0.1)
    assert estimate.pitch == pytest.approx(0.0)
    assert estimate.yaw == pytest.approx(0.3 - ORIGIN.turn)
    assert estimate.body_rates == (0.1, -0.2, 0.3)


@pytest.mark.parametrize("tick", [2_500, 5_000, 20_000])
@pytest.mark.parametrize("delay", [0, 8_000, 10_000, 13_000])
def test_a_late_estimate_is_that_of_then(delay, tick):
    late = moved(SensorProfile(delay=delay, rate_white=1e-9), tick=tick)
    estimate = late.estimate(state(1_000_000))
    then = ORIGIN.position_to_local(state(1_000_000 - delay).position)
    np.testing.assert_allclose(estimate.position, then, atol=1e-9)


@pytest.mark.parametrize("name", ["rtk", "gnss"])
def test_the_deviation_is_estimate_minus_truth(name):
    now = state(1_000_000)
    made = moved(PROFILES[name])
    estimate, off, truth = made.estimate(now), made.deviation(now), sensors(PROFILES["truth"]).estimate(now)
    np.testing.assert_allclose(
        ORIGIN.motion_to_site([estimate.position])[0] - now.position, off.position, atol=1e-8
    )
    np.testing.assert_allclose(
        ORIGIN.vectors_to_site([estimate.velocity])[0] - now.velocity, off.velocity, atol=1e-8
    )
    assert estimate.yaw - truth.yaw == pytest.approx(off.rotation[2])
    tilt = math.hypot(estimate.roll - truth.roll, estimate.pitch - truth.pitch)
    assert math.hypot(*off.rotation[:2]) == pytest.approx(tilt)
    # Rolled further than it is, with its nose at 0.3 rad: an error about an axis there.
    turn = math.atan2(off.rotation[1], off.rotation[0]) - 0.3
    assert math.cos(turn) * tilt == pytest.approx(estimate.roll - truth.roll)
    assert math.sin(turn) * tilt == pytest.approx(estimate.pitch - truth.pitch)


def test_asking_changes_nothing():
    quiet, asked = sensors(PROFILES["gnss"]), sensors(PROFILES["gnss"])
    for time in range(TICK, 3_000_001, TICK):
        for one in (quiet, asked):
            one.advance(time, state(time))
        answers = [asked.estimate(state(time)) for _ in range(3)]
        assert answers[0] == answers[1] == answers[2]
        asked.deviation(state(time))
    assert quiet.estimate(state(3_000_000)) == asked.estimate(state(3_000_000))


def test_seed_and_system_id_make_the_errors():
    profile, end = PROFILES["gnss"], state(1_000_000)
    who = ((1, 11), (1, 12), (2, 11), (1, 11))
    errors = [moved(profile, seed=seed, system_id=i).estimate(end) for seed, i in who]
    assert errors[0] == errors[3]
    assert len({error.position for error in errors}) == 3


def test_gaps_come_as_often_and_last_as_long_as_the_profile_says():
    profile = SensorProfile(gaps_per_minute=6.0, gap_least=0.1, gap_most=0.4)
    silent = [sensors(profile, system_id=i) for i in range(1, 21)]
    held = np.array([[one.silent(now) for now in range(0, 600_000_000, 20_000)] for one in silent])
    begins = (held[:, 1:] & ~held[:, :-1]).sum()
    assert begins / 200 == pytest.approx(6.0, rel=0.1)
    assert held.sum() * 0.02 / begins == pytest.approx(0.25, rel=0.1)


def test_gaps_do_not_depend_on_who_asks():
    often, seldom = sensors(PROFILES["gnss"]), sensors(PROFILES["gnss"])
    told = {now: often.silent(now) for now in range(0, 200_000_000, 5_000)}
    assert any(told.values())
    assert all(seldom.silent(now) == told[now] for now in range(0, 200_000_000, 35_000))


# The reference on the truth for the one on the estimate


@given(rotation=st.tuples(ANGLES, ANGLES, ANGLES), acceleration=st.tuples(*[st.floats(-4.0, 4.0)] * 3))
def test_a_wrong_attitude_turns_the_thrust(rotation, acceleration):
    """Against the exact rotation of the specific force by Rodrigues' formula, to second order."""
    theta, a = np.array(rotation), np.array(acceleration)
    off = Deviation(np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]), theta)
    reference = Reference(np.zeros(3), np.ones(3), a, yaw=1.0)
    shifted = believed(reference, off)
    gravity = np.array([0.0, 0.0, 9.80665])
    angle = float(np.linalg.norm(theta))
    axis = theta / angle if angle else theta
    force = a - gravity
    turned = (
        math.cos(angle) * force
        - math.sin(angle) * np.cross(axis, force)
        + (1.0 - math.cos(angle)) * (axis @ force) * axis
    )
    np.testing.assert_allclose(shifted.acceleration, turned + gravity, atol=angle**2 * 16.0 + 1e-12)
    np.testing.assert_array_equal(shifted.position, [-1.0, -2.0, -3.0])
    np.testing.assert_allclose(shifted.velocity, [0.9, 0.8, 0.7])
    assert shifted.yaw == 1.0 - theta[2]


# GPS


def gps(patience=7.0, seed=3):
    return Positioning(patience, DT, np.random.default_rng(seed))


def run(positioning, seconds):
    for _ in range(round(seconds / DT)):
        positioning.step()
    return np.array(positioning.position)


def test_nothing_happens_until_something_happens():
    calm = gps()
    assert run(calm, 20.0).tolist() == [0.0, 0.0, 0.0]
    assert (calm.nominal, calm.located, calm.fixed, calm.resets) == (True, True, True, 0)
    calm.regain()
    assert calm.nominal


def test_without_gps_the_error_grows_with_the_square_of_time_and_not_in_height():
    lost = gps()
    lost.lose()
    assert not lost.nominal
    three, six = run(lost, 3.0), run(lost, 3.0)
    np.testing.assert_allclose(six, 4.0 * three, rtol=1e-2)
    np.testing.assert_allclose(lost.velocity, 2.0 * six / 6.0, rtol=1e-2)
    assert six[2] == 0.0
    assert (lost.located, lost.fixed) == (True, False)
    run(lost, 1.1)
    assert not lost.located


def test_how_fast_it_grows_is_random():
    drifts = []
    for seed in range(300):
        lost = gps(seed=seed)
        lost.lose()
        drifts.append(run(lost, 0.5)[:2])
    assert np.std(drifts) == pytest.approx(0.5 * 0.05 * 0.25, rel=0.15)


@settings(max_examples=20)
@given(seconds=st.floats(0.5, 6.8))
def test_gps_that_is_back_in_time_takes_the_error_away_without_a_jump(seconds):
    lost = gps()
    lost.lose()
    before = run(lost, seconds)
    lost.regain()
    assert np.linalg.norm(run(lost, DT) - before) < 0.05
    np.testing.assert_allclose(run(lost, 2.0), before * math.exp(-2.01), atol=1e-3)
    assert run(lost, 20.0).tolist() == [0.0, 0.0, 0.0]
    assert (lost.nominal, lost.fixed, lost.resets) == (True, True, 0)


def test_gps_that_is_back_late_resets_the_estimate():
    lost = gps()
    lost.lose()
    run(lost, 9.0)
    lost.regain()
    assert run(lost, DT).tolist() == [0.0, 0.0, 0.0]
    assert (lost.located, lost.nominal, lost.resets) == (True, True, 1)


def test_a_small_jump_is_followed_and_a_large_one_only_after_a_while():
    small, large = gps(), gps()
    small.shift((2.0, 1.0, -1.0))
    large.shift((20.0, 0.0, 0.0))
    np.testing.assert_allclose(run(small, 1.0), np.array([2.0, 1.0, -1.0]) * (1.0 - math.exp(-1)), rtol=1e-2)
    assert small.velocity == (0.0, 0.0, 0.0)
    assert run(large, 6.9).tolist() == [0.0, 0.0, 0.0]
    assert run(large, 0.2).tolist() == [20.0, 0.0, 0.0]
    assert (small.resets, large.resets) == (0, 1)
    assert large.located
    for jumped in (small, large):
        jumped.shift((0.0, 0.0, 0.0))
        run(jumped, 30.0)
        assert jumped.nominal


def test_a_jump_that_ends_before_it_is_believed_never_happened():
    glitch = gps()
    glitch.shift((20.0, 0.0, 0.0))
    run(glitch, 5.0)
    glitch.shift((0.0, 0.0, 0.0))
    assert run(glitch, 5.0).tolist() == [0.0, 0.0, 0.0]
    glitch.shift((20.0, 0.0, 0.0))
    assert run(glitch, 6.0).tolist() == [0.0, 0.0, 0.0]
    assert glitch.resets == 0
