"""How far vehicles are from where they should be: what convergence and stand-off error mean."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from outrider.scenarios.scenario import Scenario

Array = NDArray[np.float64]


def standoff(scenario: Scenario, positions: Array, target: Array) -> Array:
    """Distance (…, K) in m of the vehicles that fly the task, ``positions`` (…, K, 3), each from its own
    surface around the ``target`` (…, 3)."""
    offset = positions - target[..., None, :]
    result = np.empty(offset.shape[:-1])
    companion = scenario.companion
    for k, system in zip(range(offset.shape[-2]), scenario.systems, strict=False):
        surface = companion.surface_of(system)
        result[..., k] = np.linalg.norm(offset[..., k, :] - surface.nearest(offset[..., k, :]), axis=-1)
    return result
