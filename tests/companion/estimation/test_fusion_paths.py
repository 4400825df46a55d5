"""Fusion over targets that do not move as the filter assumes: paths on which none of its numbers was set."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import chi2

from companion.config.target_source import FusedSource
from companion.estimation.fusion import Fusion
from companion.estimation.turn_rate import turning_path
from tests.companion.estimation.cameras import START, Vehicle, source_of
from tests.companion.estimation.flights import STEP, WINDOW, at, fused

Path = Callable[[float], "np.ndarray[tuple[int], np.dtype[np.float64]]"]
SECONDS = 6.0


def circle(time: float):
    """At 1.5 m/s on a radius of 2.5 m: a constant turn."""
    return 2.5 * np.array([np.cos(0.6 * time), np.sin(0.6 * time), 0.0])


def line(time: float):
    return np.array([-3.0 + 0.9 * time, 1.0, 0.0])


def stop_and_go(time: float):
    """Steps of acceleration of 1.5 m/s²: it sets out, stops after 3 s, and goes back."""
    gains, begins = np.array([1.5, -1.5, -1.5, 1.5]), np.array([0.0, 2.0, 4.0, 5.0])
    spent = np.clip(time - begins, 0.0, 1.0)
    gone = 0.5 * gains * spent**2 + gains * spent * np.maximum(time - begins - 1.0, 0.0)
    return np.array([-1.0 + float(gone.sum()), -0.5, 0.0])


def zigzag(time: float):
    """Its velocity changes at once, every 1.5 s."""
    phase = (time / 1.5) % 2.0
    return np.array([-2.0 + 0.8 * time, 1.2 * (phase if phase < 1.0 else 2.0 - phase), 0.0])


def flown(source: FusedSource, path: Path, seed: int):
    random = np.random.default_rng([seed, 17])
    cameras = [Vehicle(11 + k, 1.3 * k + random.uniform(), source, random) for k in range(5)]
    found = []
    for tick in range(round(1e6 * SECONDS / STEP)):
        for camera in cameras:
            camera.step(1e-6 * STEP)
            found.append(camera.sees(START + tick * STEP, path(1e-6 * tick * STEP)))
    known = at(fused(source, found), found[-1].time)
    return known.position - path(1e-6 * (found[-1].time - START)), known.covariance


def nees(source: FusedSource, path: Path, count: int) -> float:
    flights = [flown(source, path, seed) for seed in range(count)]
    return float(np.mean([off @ np.linalg.solve(P, off) for off, P in flights]))


@pytest.mark.parametrize("path", [circle, line, stop_and_go, zigzag])
def test_errors_on_other_paths_are_about_as_large_as_the_covariance_says(path):
    """The upper bound is that of χ² for as many flights; the lower one is half of the mean."""
    count = 20
    found = nees(source_of("rtk", 0.5), path, count)
    assert 1.5 < found < chi2.ppf(0.975, 3 * count) / count


def spread(source: FusedSource, random, late, seconds: float = 9.0) -> float:
    """Return tr P of a target that walks straight on; the images of each camera are ``late`` s late."""
    cameras = [Vehicle(11 + k, 1.3 * k, source, random) for k in range(len(late))]
    found = [
        camera.sees(START + tick * STEP, line(1e-6 * tick * STEP - delay))
        for tick in range(round(1e6 * seconds / STEP))
        for camera, delay in zip(cameras, late, strict=True)
    ]
    return float(np.trace(at(fused(source, found), found[-1].time).covariance))


def ahead(
    path: Path, rate: float, seconds: float = 1.6, settled: float = 2.0, seed: int = 31
) -> tuple[float, float]:
    """Return the RMS of errors (m) of the way in the next ``seconds``, by the estimates of one flight.

    First with ``rate`` times the estimated turn rate, then straight on.
    """
    source, random = source_of("rtk", 0.5), np.random.default_rng(seed)
    cameras = [Vehicle(11 + k, 1.3 * k, source, random) for k in range(5)]
    fusion, squares = Fusion(source, WINDOW), []
    for tick in range(round(1e6 * SECONDS / STEP)):
        time = 1e-6 * tick * STEP
        for camera in cameras:
            fusion.put(camera.sees(START + tick * STEP, path(time)))
        if time >= settled:
            known, way = at(fusion, START + tick * STEP), path(time + seconds) - path(time)
            ends = [
                turning_path(np.zeros(3), known.velocity, turn, np.array([seconds])).positions[0] - way
                for turn in (rate * known.turn_rate, 0.0)
            ]
            squares.append([float(end[:2] @ end[:2]) for end in ends])
    bent, straight = np.sqrt(np.mean(squares, axis=0)).tolist()
    return bent, straight


def test_the_way_ahead_bends_as_the_targets():
    """On a circle the end of a horizon is less than half as far from the truth as straight on."""
    bent, straight = ahead(circle, 1.0)
    assert bent < 0.5 * straight
    # Turned to the other side it would be farther.
    assert ahead(circle, -1.0)[0] > 1.2 * straight


def test_of_a_target_that_walks_straight_on_the_way_ahead_is_about_straight():
    bent, straight = np.mean([ahead(line, 1.0, seed=seed) for seed in range(31, 37)], axis=0)
    assert bent < straight + 0.1


def test_of_a_target_that_rests_the_turn_rate_is_small():
    """Its velocity is noise, which has a course, and changes it all the time."""
    source, random, rates = source_of("rtk", 0.5), np.random.default_rng(4), []
    cameras = [Vehicle(11 + k, 1.3 * k, source, random) for k in range(5)]
    fusion = Fusion(source, WINDOW)
    for tick in range(60):
        for camera in cameras:
            fusion.put(camera.sees(START + tick * STEP, np.zeros(3)))
        known = at(fusion, START + tick * STEP)
        rates.append(abs(known.turn_rate) * float(np.linalg.norm(known.velocity)))
    assert max(rates[20:]) < 0.4


def fixed(source: FusedSource) -> FusedSource:
    return source.model_copy(update={"adapt": 1.0})


def test_images_that_are_late_are_not_taken_for_accelerations():
    """Cameras that disagree by their clocks make innovations larger, but the target walks straight on."""
    source, random = source_of("truth", 0.35), np.random.default_rng(5)
    larger = []
    for _ in range(6):
        late = 1e-6 * source.errors.sigma_image_us * random.normal(size=5)
        larger.append(spread(source, random, late) / spread(fixed(source), random, late))
    assert np.mean(larger) < 1.0


def test_it_learns_that_the_target_accelerates_less_but_not_that_it_never_does():
    """The covariance is between those of the configured σ and of half of it."""
    source, random = source_of("truth", 0.5), np.random.default_rng(6)
    half = source.model_copy(update={"sigma_acceleration": 0.25, "sigma_climb": 0.1})
    adapted, known, least = (
        np.mean([spread(one, random, [0.0] * 5) for _ in range(4)])
        for one in (source, fixed(source), fixed(half))
    )
    assert least < adapted < 0.97 * known


def test_it_learns_how_the_target_accelerates():
    """With a σ a tenth of the target's, the covariance is far too small unless it is adapted."""
    timid = source_of("truth", 0.06)
    fixed = nees(timid.model_copy(update={"adapt": 1.0}), circle, 5)
    assert fixed > 15.0
    assert nees(timid, circle, 5) < 0.4 * fixed
