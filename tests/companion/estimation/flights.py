"""Flights of cameras around a walker, and the fusion of what they see."""

from __future__ import annotations

import numpy as np

from companion.config.target_source import FusedSource
from companion.estimation.fusion import Fusion
from tests.companion.estimation.cameras import START, Vehicle, Walker, source_of

WINDOW = 2_000_000
STEP = 100_000


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
