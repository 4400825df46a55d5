"""Fusion over targets that do not move as the filter assumes: paths on which none of its numbers was set."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import chi2

from companion.config.target_source import FusedSource
from tests.companion.estimation.cameras import START, Vehicle, source_of
from tests.companion.estimation.test_fusion import STEP, at, fused

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
