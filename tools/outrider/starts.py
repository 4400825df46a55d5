"""Where the vehicles of a scenario start and, in an antipodal swap, where each must go."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from outrider.scenario import Scenario

Array = NDArray[np.float64]


class Starts(NamedTuple):
    """Fleet-local ENU, m. ``positions`` (K, 3): where each hovers first, jittered; ``goals`` (K, 3) or
    None."""

    positions: Array
    goals: Array | None


def starts(scenario: Scenario, seed: int, planar: bool) -> Starts:
    """Evenly on the ring, each moved within a ball of ``jitter`` (a disc if ``planar``); the goal is the
    opposite point of the ring, not of the jittered start. ``seed`` alone decides the jitter."""
    ring, count = scenario.starts, scenario.vehicles
    angles = math.radians(ring.first_deg) + 2.0 * math.pi * np.arange(count) / count
    slots = np.column_stack(
        [
            ring.centre[0] + ring.radius * np.cos(angles),
            ring.centre[1] + ring.radius * np.sin(angles),
            np.full(count, ring.height),
        ]
    )
    random = np.random.default_rng(seed)
    direction = random.normal(size=(count, 3))
    if planar:
        direction[:, 2] = 0.0
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    radius = ring.jitter * np.cbrt(random.uniform(size=(count, 1)))
    goals = None
    if scenario.task == "antipodal":
        goals = slots.copy()
        goals[:, 0] = 2.0 * ring.centre[0] - slots[:, 0]
        goals[:, 1] = 2.0 * ring.centre[1] - slots[:, 1]
    return Starts(slots + direction * radius, goals)
