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


def test_it_learns_how_the_target_accelerates():
    """With a σ a tenth of the target's, the covariance is far too small unless it is adapted."""
    timid = source_of("truth", 0.06)
    fixed = nees(timid.model_copy(update={"adapt": 1.0}), circle, 5)
    assert fixed > 15.0
    assert nees(timid, circle, 5) < 0.4 * fixed
