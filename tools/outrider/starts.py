"""Where the vehicles of a scenario start and, where they have goals, where each must go."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from outrider.scenario import Scenario
from outrider.scenario_places import Points, Ring
from outrider.streams import Stream, stream

Array = NDArray[np.float64]


class Starts(NamedTuple):
    """Fleet-local ENU, m. ``positions`` (K, 3): where each hovers first, jittered; ``goals`` (K, 3) or
    None."""

    positions: Array
    goals: Array | None


def starts(scenario: Scenario, seed: int, planar: bool) -> Starts:
    """Each at its place, moved within a ball of ``jitter`` (a disc if ``planar``), which ``seed`` alone
    decides.

    On a ring the places are even, and in an antipodal swap the goal is the opposite point of the ring, not of
    the jittered start.
    """
    config, count = scenario.starts, scenario.vehicles
    if isinstance(config, Points):
        slots = np.array(config.at)
        goals = None if config.goals is None else np.array(config.goals)
    else:
        slots = _on_ring(config, count)
        goals = None
        if scenario.task == "antipodal":
            goals = slots.copy()
            goals[:, :2] = 2.0 * np.array(config.centre) - slots[:, :2]
    random = stream(seed, Stream.STARTS)
    direction = random.normal(size=(count, 3))
    if planar:
        direction[:, 2] = 0.0
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    radius = config.jitter * np.cbrt(random.uniform(size=(count, 1)))
    return Starts(slots + direction * radius, goals)


def _on_ring(ring: Ring, count: int) -> Array:
    angles = math.radians(ring.first_deg) + 2.0 * math.pi * np.arange(count) / count
    return np.column_stack(
        [
            ring.centre[0] + ring.radius * np.cos(angles),
            ring.centre[1] + ring.radius * np.sin(angles),
            np.full(count, ring.height),
        ]
    )
