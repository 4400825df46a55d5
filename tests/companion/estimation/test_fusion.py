"""Laws of the fusion of detections: consistent, independent of the order of arrival, bounded in what one
sender can do."""

from __future__ import annotations

from math import atan2, radians, sqrt

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from companion.config.target_source import FusedSource, OwnErrors
from companion.estimation.detections import Detection, detection
from companion.estimation.fusion import Fusion
from companion.estimation.fusion_filter import ADAPTED, FIELDS, MARKS, NOISE, PER_VEHICLE, TARGET, replay
from mavlink_bridge.pinhole import Pinhole, conjugate, extent, rotated, sighting, upward
from sitl.values.attitudes import quaternion
from tests.companion.estimation.cameras import (
    ACROSS_DEG,
    ALONG,
    START,
    Vehicle,
    Walker,
    message,
    singer,
    source_of,
    taller,
)

WINDOW = 2_000_000
STEP = 100_000
EXACT = OwnErrors(
    sigma_horizontal=0.0,
    sigma_vertical=0.0,
    sigma_yaw_deg=0.0,
    sigma_tilt_deg=0.0,
    sigma_white=0.0,
    sigma_time_us=0.0,
    sigma_image_us=0.0,
)


def flight(profile, seed: int, seconds: float = 6.0, vehicles: int = 3):
    """Detections of a walker, and where it was in the end."""
    random = np.random.default_rng([seed, vehicles])
    source = source_of(profile)
    cameras = [Vehicle(11 + k, 2.1 * k + random.uniform(), source, random) for k in range(vehicles)]
    walker, found = Walker(random, source), []
    for tick in range(round(1e6 * seconds / STEP)):
        walker.step(1e-6 * STEP)
        for camera in cameras:
            camera.step(1e-6 * STEP)
            found.append(camera.sees(START + tick * STEP, walker.place, walker.velocity))
    return source, found, walker


def fused(source: FusedSource, detections) -> Fusion:
    fusion = Fusion(source, WINDOW)
    for one in detections:
        fusion.put(one)
    return fusion


def at(fusion: Fusion, time: int):
    known = fusion.at(time, 1_000_000)
    assert known is not None
    return known


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
            R = R * (np.linalg.norm(other.x[:3, 0] - one.fields[18:21]) / one.fields[21]) ** 2
        other.update(one.fields[:3], R=R)
    other.predict()
    np.testing.assert_allclose(known.position, other.x[:3, 0], atol=1e-6)
    np.testing.assert_allclose(known.velocity, other.x[3:6, 0], atol=1e-5)
    np.testing.assert_allclose(known.covariance, other.P[:3, :3], rtol=1e-4, atol=1e-9)


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


@given(st.integers(0, 500), st.tuples(*[st.floats(-30.0, 30.0)] * 3))
@settings(max_examples=40)
def test_one_detection_moves_the_estimate_by_no_more_than_its_gate_allows(seed, by):
    """‖Δp‖² ≤ γ·λ_max(P): Δp = K y, K S Kᵀ = P − P⁺ ≤ P, and yᵀS⁻¹y ≤ γ."""
    source, found, _ = flight("gnss", seed, 1.0)
    end = found[-1].time
    before, wrong = at(fused(source, found), end), found[-1]
    fields = wrong.fields.copy()
    fields[:3] += by
    after = at(fused(source, [*found, replace_fields(wrong, end, fields)]), end)
    most = sqrt(source.gate * float(np.linalg.eigvalsh(before.covariance)[-1]))
    assert float(np.linalg.norm(after.position - before.position)) <= most


def replace_fields(one: Detection, time: int, fields) -> Detection:
    return one._replace(time=time, fields=fields, vehicle=one.vehicle)


@pytest.mark.parametrize("strategy", ["edge", "patient"])
@pytest.mark.parametrize("profile", ["truth", "rtk", "gnss"])
def test_one_compromised_neighbour_of_five_moves_it_by_a_few_sigmas_at_most(profile, strategy):
    """It knows the filter, and always pushes east: to the edge of the gate, or just below suspicion."""
    worst = []
    for seed in range(4):
        source, found, _ = flight(profile, seed, 6.0, vehicles=5)
        honest, attacked = Fusion(source, WINDOW), Fusion(source, WINDOW)
        share = 0.999 if strategy == "edge" else sqrt(5.5 / source.gate)
        for one in found:
            if one.vehicle != 15:
                honest.put(one)
                attacked.put(one)
            elif one.time > START + 1_000_000:
                attacked.put(one._replace(fields=pushed(attacked, one, share)))
        a, b = at(honest, found[-1].time), at(attacked, found[-1].time)
        sigma = sqrt(float(np.linalg.eigvalsh(a.covariance)[-1]))
        worst.append(float(np.linalg.norm(a.position - b.position)) / sigma)
    assert max(worst) < sqrt(source_of(profile).gate)


def pushed(fusion: Fusion, one: Detection, share: float):
    """The detection, moved east as far as a share of the gate allows."""
    known = at(fusion, one.time)
    fields = one.fields.copy()
    R = fields[3:12].reshape(3, 3)
    reach = sqrt(16.27) * share * sqrt(float((known.covariance + R)[0, 0]))
    fields[:3] = known.position + np.array([reach, 0.0, 0.0])
    return fields


def test_false_detections_make_no_jump():
    random = np.random.default_rng(5)
    for seed in range(5):
        source, found, _ = flight("rtk", seed, 6.0)
        wrong = [
            one._replace(fields=np.concatenate([random.uniform(-15, 15, 3), one.fields[3:]]))
            if random.uniform() < 0.05 and one.time > START
            else one
            for one in found
        ]
        clean, fusion = Fusion(source, WINDOW), Fusion(source, WINDOW)
        for one, other in zip(found, wrong, strict=True):
            clean.put(one)
            fusion.put(other)
            if one.time > START + 1_000_000:
                a, b = at(clean, one.time), at(fusion, one.time)
                assert np.linalg.norm(a.position - b.position) < 1.0


def adapted(fusion: Fusion) -> float:
    """θ of the horizontal acceleration after the last detection."""
    assert at(fusion, START).time
    return float(fusion._memories[len(fusion._detections) - 1, 0])


def test_false_detections_say_nothing_of_the_targets_acceleration():
    """One in ten is false, whoever detects: the acceleration's σ grows by less than a third in 8 s.

    Counted with d² = ``gate``, as those of a target that turned, they make it eight times as large.
    """
    random = np.random.default_rng(7)
    for seed in range(2):
        source, found, _ = flight("rtk", seed, 8.0)
        wrong = [
            one._replace(fields=np.concatenate([random.uniform(-15, 15, 3), one.fields[3:]]))
            if random.uniform() < 0.1
            else one
            for one in found
        ]
        grown = adapted(fused(source, wrong)) - adapted(fused(source, found))
        assert np.exp(0.5 * grown) < 1.33


def test_refused_detections_that_agree_say_that_the_target_accelerates():
    """It rests for 3 s, then runs at 6 m/s at once: all are refused, and θ grows at once."""
    source, random = source_of("truth", 0.1), np.random.default_rng(3)
    cameras = [Vehicle(11 + k, 1.3 * k, source, random) for k in range(4)]
    fusion = Fusion(source, WINDOW)
    for tick in range(34):
        time = START + tick * STEP
        place = np.array([6.0 * max(0.1 * (tick - 30), 0.0), 0.0, 0.0])
        for camera in cameras:
            fusion.put(camera.sees(time, place))
        if tick == 30:
            before = adapted(fusion)
    assert adapted(fusion) > before + 1.0


def test_after_a_false_beginning_it_begins_anew():
    source, found, walker = flight("rtk", 2, 4.0)
    fields = found[0].fields.copy()
    fields[:3] += 30.0
    fusion = Fusion(source, WINDOW)
    for one in (found[0]._replace(fields=fields), *found[1:]):
        fusion.put(one)
        fusion.at(one.time, WINDOW)
    known = at(fusion, found[-1].time)
    assert np.linalg.norm(known.position - walker.place) < 0.5
    # After a second without anything that passes, or at once if the first was not trusted.
    assert known.time == found[-1].time


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


@pytest.mark.parametrize(
    "changes",
    [
        {"horizontal_accuracy": 0.0},
        {"horizontal_accuracy": -1.0},
        {"vertical_accuracy": 1e6},
        {"heading_accuracy": 3.0},
        {"heading_accuracy": 0.0},
    ],
)
def test_absurd_accuracies_are_no_detection(changes):
    camera, place = np.array([6.0, 0.0, 5.0]), np.zeros(3)
    good = message(11, place, camera)
    assert detection(source_of("rtk"), 11, START, place, camera, good) is not None
    assert detection(source_of("rtk"), 11, START, place, camera, good._replace(**changes)) is None
    assert detection(source_of("rtk"), 11, START, place, place, good) is None


@given(st.tuples(*[st.floats(-50.0, 50.0)] * 3), st.tuples(*[st.floats(-20.0, 20.0)] * 3))
@settings(max_examples=60)
def test_a_detection_has_the_covariance_of_its_camera_and_the_directions_of_its_errors(place, offset):
    """R has σ² along the ray, sideways, and up; yaw and elevation move the place to the left and up."""
    camera = np.add(place, offset)
    ray = np.subtract(place, camera)
    distance = float(np.linalg.norm(ray))
    # Nearer ones are at the least σ that is believed.
    assume(distance > 5.0 and np.hypot(ray[0], ray[1]) > 0.01)
    found = detection(source_of("rtk"), 11, START, place, tuple(camera), message(11, np.array(place), camera))
    assert found is not None
    fields, ray = found.fields, ray / distance
    across = radians(ACROSS_DEG) * distance
    along = ALONG * distance
    left, up = fields[12:15], fields[15:18]
    sigmas = along, across, across * taller(np.subtract(place, camera))
    axes = np.array([ray, left / np.linalg.norm(left), up])
    R = axes.T @ np.diag(np.square(sigmas)) @ axes
    np.testing.assert_allclose(fields[3:12].reshape(3, 3), R, rtol=1e-6, atol=1e-9 * distance**2)
    np.testing.assert_allclose(left, np.cross((0.0, 0.0, 1.0), ray), atol=1e-12)
    np.testing.assert_allclose(np.cross(ray, left), np.linalg.norm(left) * up, atol=1e-12)
    np.testing.assert_array_equal(fields[:3], place)
    np.testing.assert_array_equal(fields[18:21], camera)
    assert fields.shape == (FIELDS,)
    assert fields[21] == pytest.approx(distance, rel=1e-14)


@pytest.mark.parametrize("level", [3.0, 6.0, 12.0])
@pytest.mark.parametrize("above", [2.0, 5.0, 8.0])
def test_a_detection_has_the_variances_of_the_camera_along_its_ray_sideways_and_up(level, above):
    """A camera that looks at the foot of a person; 276 does not say the accuracy of the elevation."""
    lens, pitch = Pinhole.of_field(1280, 720, radians(70.0)), atan2(above, level)
    attitude = quaternion(0.0, -pitch, 0.0)
    foot = rotated(conjugate(attitude), (level, 0.0, above))
    seen = extent(lens, foot, upward(attitude), 1.8)
    found = sighting(lens, attitude, seen, 1.8, 8.0, 0.15)
    assert found is not None
    # Looking north: NED and ENU.
    camera, place = np.array([0.0, 0.0, above]), np.array([0.0, level, 0.0])
    said = message(11, place, camera)._replace(
        horizontal_accuracy=found.horizontal_accuracy,
        vertical_accuracy=found.vertical_accuracy,
        heading_accuracy=found.heading_accuracy,
    )
    one = detection(source_of("rtk"), 11, START, tuple(place), tuple(camera), said)
    assert one is not None
    ray = np.array([level, 0.0, above]) / np.hypot(level, above)
    for axis in (ray, np.array([0.0, 1.0, 0.0]), np.array([ray[2], 0.0, -ray[0]])):
        true = axis @ found.errors @ axis
        fleet = np.array([axis[1], axis[0], -axis[2]])
        assert fleet @ one.fields[3:12].reshape(3, 3) @ fleet == pytest.approx(true, rel=0.02)


def test_what_was_seen_recently_is_counted_by_vehicle_with_its_median_weight():
    source, found, _ = flight("rtk", 6, 1.9)
    found[25] = found[25]._replace(fields=np.concatenate([[40.0, 0.0, 0.0], found[25].fields[3:]]))
    fusion, since = fused(source, found[::-1]), found[0].time + 500_000
    used = [one for one in found if one is not found[25] and one.time >= since]
    seen = fusion.recent(since)
    assert set(seen) == {11, 12, 13}
    assert fusion.refused == 1
    for vehicle, (number, weight) in seen.items():
        weights = [one.weight for one in used if one.vehicle == vehicle]
        assert number == len(weights)
        assert weight == pytest.approx(np.median(weights), rel=1e-12)
    assert fusion.recent(found[-1].time + 1) == {}


def test_one_detection_that_weighs_a_hundred_times_as_much_hardly_changes_the_weight():
    """A false detection nearby that passes: w_k is computed with the measured distance."""
    source, found, _ = flight("rtk", 6, 1.9)
    since = found[0].time + 500_000
    clean = fused(source, found).recent(since)
    row = max(k for k, one in enumerate(found) if one.vehicle == 12)
    found[row] = found[row]._replace(weight=100.0 * found[row].weight)
    seen = fused(source, found).recent(since)
    assert seen[12].weight == pytest.approx(clean[12].weight, rel=0.1)
    assert (seen[11], seen[13]) == (clean[11], clean[13])


def test_detections_beyond_the_window_are_remembered():
    """Up to 16 of each vehicle, however long ago: of rare ones all count."""
    source = source_of("truth")
    camera, place, period = np.array([6.0, 0.0, 5.0]), np.zeros(3), 1_100_000
    found = [
        detection(source, 11, START + k * period, place, tuple(camera), message(11, place, camera))
        for k in range(15)
    ]
    fusion = fused(source, [one for one in found if one is not None])
    for count in (1, 3, 9, 15):
        seen = fusion.recent(START + (15 - count) * period)
        assert seen[11].number == count
        assert seen[11].weight == pytest.approx(found[0].weight, rel=1e-6)


def test_a_new_beginning_forgets_who_saw_the_wrong_place():
    """Vehicle 12 sees a wrong place for six seconds, alone; then 11 sees the true one."""
    source, camera = source_of("truth"), np.array([6.0, 0.0, 5.0])
    fusion = Fusion(source, WINDOW)
    for tick in range(120):
        vehicle, place = (12, np.array([20.0, 0.0, 0.0])) if tick < 60 else (11, np.zeros(3))
        if not 60 <= tick < 75:
            time = START + tick * STEP
            one = detection(source, vehicle, time, place, tuple(camera), message(vehicle, place, camera))
            assert one is not None
            fusion.put(one)
            fusion.at(time, WINDOW)
    assert fusion.restarts == 1
    assert set(fusion.recent(START)) == {11}


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
