"""Formation error: distance of vehicles from their surfaces around the target.

The stand-off error is this distance; convergence without goals is defined by it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from outrider.scenarios.scenario import Scenario

Array = NDArray[np.float64]


def standoff(scenario: Scenario, positions: Array, target: Array) -> Array:
    """Return the distance (…, K) in m of each vehicle from its own surface around the target.

    ``positions`` (…, K, 3) in the order of the scenario's systems; ``target`` (…, 3); fleet-local ENU, m.
    """
    offset = positions - target[..., None, :]
    result = np.empty(offset.shape[:-1])
    companion = scenario.companion
    for k, system in zip(range(offset.shape[-2]), scenario.systems, strict=False):
        surface = companion.surface_of(system)
        result[..., k] = np.linalg.norm(offset[..., k, :] - surface.nearest(offset[..., k, :]), axis=-1)
    return result
