"""Laws of the fusion of detections: consistent, and independent of the order of arrival."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from companion.config.target_source import FusedSource, OwnErrors
from companion.estimation.detections import Detection, detection
from companion.estimation.fusion import Fusion
from companion.estimation.fusion_filter import ADAPTED, FIELDS, MARKS, NOISE, PER_VEHICLE, TARGET, replay
from tests.companion.estimation.cameras import START, Vehicle, message, singer, source_of
from tests.companion.estimation.flights import STEP, WINDOW, at, flight, fused

EXACT = OwnErrors(
    sigma_horizontal=0.0,
    sigma_vertical=0.0,
    sigma_yaw_deg=0.0,
    sigma_tilt_deg=0.0,
    sigma_white=0.0,
    sigma_time_us=0.0,
    sigma_image_us=0.0,
)


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["truth", "rtk", "gnss"])
def test_errors_are_as_large_as_the_covariance_says(profile):
    """NEES of the position over flights with other errors, and NIS, within the 95 % bands of χ².

    The acceleration's σ is known and not adapted: with an estimated one the bands hold approximately only.
    All images are as much earlier or later than they say, by the σ that the filter assumes.
    """
    count, nees, nis = 150, [], []
    for seed in range(count):
        source, found, walker = flight(profile, seed, 4.0)
        fusion = fused(source.model_copy(update={"gate": 1e3, "adapt": 1.0}), found)
        known = at(fusion, found[-1].time)
        late = 1e-6 * source.errors.sigma_time_us * np.random.default_rng([seed, 91]).normal()
        off = known.position - walker.place - late * walker.velocity
        nees.append(float(off @ np.linalg.solve(known.covariance, off)))
        # The first ones say where it is.
        nis.append(fusion.innovations[9:])
    low, high = chi2.ppf([0.025, 0.975], 3 * count) / count
    assert low < np.mean(nees) < high
    numbers = np.concatenate(nis)
    low, high = chi2.ppf([0.025, 0.975], 3 * len(numbers)) / len(numbers)
    assert low < numbers.mean() < high


def test_treated_as_white_a_bias_of_gnss_makes_it_far_too_confident():
    nees = []
    for seed in range(10):
        source, found, walker = flight("gnss", seed, 4.0)
        known = at(fused(source.model_copy(update={"own_errors": EXACT, "gate": 1e3}), found), found[-1].time)
        off = known.position - walker.place
        nees.append(float(off @ np.linalg.solve(known.covariance, off)))
    assert np.mean(nees) > 30.0


def escorted(source: FusedSource, speed: float, age: float, seconds: float = 4.0):
    """Exact detections of a target that walks east, by vehicles that keep beside it.

    Each states where it was ``age`` s ago. Return them and where the target was in the last image.
    """
    found, place = [], np.zeros(3)
    for tick in range(round(1e6 * seconds / STEP)):
        place = np.array([1e-6 * STEP * tick * speed, 0.0, 0.0])
        for k in range(3):
            camera = place + np.array([6.0 * np.cos(2.1 * k), 6.0 * np.sin(2.1 * k), 5.0])
            stated = np.array([age * speed, 0.0, 0.0])
            seen, believed = place - stated, camera - stated
            one = detection(
                source, 11 + k, START + tick * STEP, seen, believed, message(11 + k, seen, believed)
            )
            assert one is not None
            found.append(one)
    return found, place


@pytest.mark.parametrize("speed", [0.0, 1.5, 4.0])
def test_the_age_of_stated_positions_is_no_lag_of_the_target(speed):
    """All vehicles that move with the target have the same error, so without the correction it remains."""
    age = 0.05
    source = source_of("rtk").model_copy(update={"own_errors": EXACT})
    found, place = escorted(source, speed, age)
    lagging = at(fused(source, found), found[-1].time)
    np.testing.assert_allclose(lagging.position, place - [age * speed, 0.0, 0.0], atol=2e-3)
    errors = EXACT.model_copy(update={"age_us": round(1e6 * age)})
    known = at(fused(source.model_copy(update={"own_errors": errors}), found), found[-1].time)
    np.testing.assert_allclose(known.position, place, atol=2e-3)


def test_an_error_of_the_times_in_common_is_uncertainty_along_the_way():
    source = source_of("rtk")
    found, _ = escorted(source, 3.0, 0.0)
    sure = source.errors.model_copy(update={"sigma_time_us": 0.0})
    unsure = source.errors.model_copy(update={"sigma_time_us": 20_000.0})
    a, b = (
        at(fused(source.model_copy(update={"own_errors": errors}), found), found[-1].time)
        for errors in (sure, unsure)
    )
    np.testing.assert_array_equal(a.position, b.position)
    along = 0.02 * a.velocity
    assert along[0] == pytest.approx(0.06, rel=0.02)
    np.testing.assert_allclose(b.covariance - a.covariance, np.outer(along, along), atol=1e-9)


@given(st.integers(0, 1000))
@settings(max_examples=15)
def test_the_order_of_arrival_does_not_matter(seed):
    source, found, _ = flight("rtk", seed, 1.5)
    shuffled = [found[k] for k in np.random.default_rng(seed).permutation(len(found))]
    first, second = Fusion(source, WINDOW), Fusion(source, WINDOW)
    for one in found:
        first.put(one)
    for k, one in enumerate(shuffled):
        second.put(one)
        if k % 7 == 0:
            second.at(one.time, WINDOW)
    a, b = at(first, found[-1].time), at(second, found[-1].time)
    # Vehicles are numbered as they are first seen, so sums are rounded otherwise: beside the variance of the
    # first place, (100 m)², 1e-12 of it is (1e-4 m)².
    np.testing.assert_allclose(a.position, b.position, atol=1e-5)
    np.testing.assert_allclose(a.covariance, b.covariance, atol=1e-6)
    assert first.used == second.used


def axes(ray):
    """Ray, horizontal direction across it, and the third one, as rows."""
    ray = ray / np.linalg.norm(ray)
    across = np.cross([0.0, 0.0, 1.0], ray) / np.hypot(ray[0], ray[1])
    return np.stack([ray, across, np.cross(ray, across)])


def expected(R, fields, place, P):
    """Covariance of a detection on the ray to the expected ``place`` (3,), m, with the covariance ``P``."""
    measured, ray = fields[:3] - fields[18:21], place - fields[18:21]
    before, after = axes(measured), axes(ray)
    variances = np.diag(before @ R @ before.T).copy()
    variances[1:] += variances[0] / (ray @ ray) * np.diag(after @ P @ after.T)[1:]
    return after.T @ np.diag(variances) @ after * (ray @ ray) / fields[21] ** 2


@pytest.mark.parametrize("dt", [0.02, 0.3])
def test_without_lasting_errors_it_is_filterpys_kalman_filter(dt):
    """With intervals below and above those for which the covariance of the motion is a series."""
    filterpy = pytest.importorskip("filterpy.kalman")
    source, found, _ = flight("truth", 3, 1.0, vehicles=1)
    found = [one._replace(time=START + round(k * 1e6 * dt)) for k, one in enumerate(found)]
    source = source.model_copy(update={"own_errors": EXACT, "gate": 1e9, "adapt": 1.0})
    known = at(fused(source, found), found[-1].time + round(1e6 * dt))
    other = filterpy.KalmanFilter(dim_x=9, dim_z=3)
    other.x = np.concatenate([found[0].fields[:3], np.zeros(6)])[:, None]
    variances = np.array([source.sigma_acceleration] * 2 + [source.sigma_climb]) ** 2
    other.P = np.diag([1e4] * 3 + [4.0] * 3 + variances.tolist())
    other.H = np.eye(3, 9)
    F, Q = singer(dt, 1.0 / source.acceleration_s)
    other.F, other.Q = np.kron(F, np.eye(3)), np.kron(Q, np.diag(variances))
    for one in found:
        if one is not found[0]:
            other.predict()
        R = one.fields[3:12].reshape(3, 3)
        if np.trace(other.P[:3, :3]) < 25.0:
            R = expected(R, one.fields, other.x[:3, 0], other.P[:3, :3])
        other.update(one.fields[:3], R=R)
    other.predict()
    np.testing.assert_allclose(known.position, other.x[:3, 0], atol=1e-6)
    np.testing.assert_allclose(known.velocity, other.x[3:6, 0], atol=1e-5)
    np.testing.assert_allclose(known.covariance, other.P[:3, :3], rtol=1e-4, atol=1e-9)


def test_cameras_on_one_side_do_not_draw_a_target_that_rests_towards_them():
    """σ along a ray is forty times that across it: with measured rays as axes the mean error is 0.08 m."""
    source, off, nees = source_of("rtk", 0.35), [], []
    for seed in range(12):
        random = np.random.default_rng([seed, 5])
        cameras = [Vehicle(11 + k, 1.2 * (k - 1), source, random) for k in range(3)]
        found = []
        for tick in range(80):
            for camera in cameras:
                camera.step(1e-6 * STEP)
                found.append(camera.sees(START + tick * STEP, np.zeros(3)))
        known = at(fused(source, found), found[-1].time)
        off.append(known.position)
        nees.append(float(known.position @ np.linalg.solve(known.covariance, known.position)))
    assert (np.abs(np.mean(off, axis=0)) < 3.0 * np.std(off, axis=0) / np.sqrt(len(off))).all()
    assert np.mean(nees) < chi2.ppf(0.975, 3 * len(nees)) / len(nees)


def test_several_cameras_are_better_than_the_best():
    errors = []
    for seed in range(20):
        source, found, walker = flight("rtk", seed, 4.0, vehicles=5)
        alone = [
            at(fused(source, [d for d in found if d.vehicle == 11 + k]), found[-1].time) for k in range(5)
        ]
        all_ = at(fused(source, found), found[-1].time)
        errors.append([np.linalg.norm(one.position - walker.place) ** 2 for one in (*alone, all_)])
    *single, together = np.sqrt(np.mean(errors, axis=0))
    assert together <= 0.55 * min(single)


def test_a_lost_target_moves_on_for_a_bounded_time_and_becomes_uncertain():
    source, found, _ = flight("rtk", 1)
    fusion = fused(source, found)
    end = found[-1].time
    traces, places = [], []
    for after in (0, 500_000, 1_000_000, 3_000_000, 10_000_000):
        known = at(fusion, end + after)
        traces.append(np.trace(known.covariance))
        places.append(known.position)
        assert known.time == end
    assert traces == sorted(traces)
    np.testing.assert_array_equal(places[2], places[3])
    np.testing.assert_array_equal(at(fusion, end + 10_000_000).velocity, 0.0)


def test_an_estimate_that_has_the_same_detections_makes_it_no_more_confident():
    """Covariance intersection with the own estimate: the same information once more is none."""
    source, found, _ = flight("rtk", 4, 2.0)
    fusion = fused(source, found)
    known = at(fusion, found[-1].time)
    fields = found[-1].fields.copy()
    fields[:3], fields[3:12] = known.position, known.covariance.ravel()
    for _ in range(20):
        fusion.put(Detection(14, found[-1].time, fields, True, 1.0, found[-1].message))
    again = at(fusion, found[-1].time)
    assert np.trace(again.covariance) >= 0.999 * np.trace(known.covariance)
    np.testing.assert_allclose(again.position, known.position, atol=1e-6)


def test_a_better_estimate_of_others_is_used():
    source, found, walker = flight("gnss", 4, 2.0)
    known = at(fused(source, found), found[-1].time)
    fields = found[-1].fields.copy()
    fields[:3], fields[3:12] = walker.place, (0.01 * np.eye(3)).ravel()
    better = fused(source, [*found, Detection(14, found[-1].time, fields, True, 1.0, found[-1].message)])
    again = at(better, found[-1].time)
    assert np.trace(again.covariance) < 0.5 * np.trace(known.covariance)
    assert np.linalg.norm(again.position - walker.place) < np.linalg.norm(known.position - walker.place)


def test_what_is_older_than_the_window_is_late():
    source, found, _ = flight("rtk", 1, 4.0)
    fusion = fused(source, found)
    assert not fusion.put(found[0])
    assert fusion.late == 1


def test_memory_is_bounded_and_forgetting_changes_nothing():
    source, found, _ = flight("rtk", 1, 12.0, vehicles=2)
    short, long = Fusion(source, 500_000), Fusion(source, 20_000_000)
    for one in found:
        short.put(one)
        long.put(one)
        short.at(one.time, WINDOW)
    a, b = at(short, found[-1].time), at(long, found[-1].time)
    assert len(short._detections) < 32
    assert len(long._detections) == len(found)
    assert short.used + short.refused == len(found)
    np.testing.assert_allclose(a.position, b.position, atol=1e-9)
    np.testing.assert_allclose(a.covariance, b.covariance, atol=1e-9)


def test_more_detections_at_once_than_are_kept_are_all_processed():
    source, found, _ = flight("rtk", 3, 22.0)
    assert len(found) == 660
    once, singly = Fusion(source, 60_000_000), Fusion(source, 60_000_000)
    for one in found:
        once.put(one)
    for one in found:
        singly.put(one)
        singly.at(one.time, WINDOW)
    a, b = at(once, found[-1].time), at(singly, found[-1].time)
    np.testing.assert_allclose(a.position, b.position, atol=1e-9)
    np.testing.assert_allclose(a.covariance, b.covariance, atol=1e-9)
    assert (once.used, once.refused) == (singly.used, singly.refused)


def test_a_kernel_of_no_vehicle_and_no_detection_does_nothing():
    n, memory = TARGET + PER_VEHICLE, ADAPTED + MARKS
    empty = np.zeros(0, dtype=np.int64)
    replay(
        empty, empty, np.zeros((0, FIELDS)), 0, 0, START,
        np.zeros(n), np.eye(n), np.zeros(memory), np.ones(NOISE),
        np.zeros((0, n)), np.zeros((0, n, n)), np.zeros((0, memory)), np.zeros(0, dtype=bool), np.zeros(0),
    )  # fmt: skip
