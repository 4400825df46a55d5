"""Starts of a scenario's vehicles and, where they have goals, the goals."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from outrider.scenarios.places import Points, Ring
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.streams import Stream, stream

Array = NDArray[np.float64]


class Starts(NamedTuple):
    """Starts and goals, fleet-local ENU, m.

    ``positions`` (K, 3): where each vehicle hovers first, jittered, bystanders last; ``goals`` (vehicles, 3)
    of the vehicles with the task, or None.
    """

    positions: Array
    goals: Array | None


def starts(scenario: Scenario, seed: int, planar: bool) -> Starts:
    """Return the starts, moved at random within a ball of ``jitter`` (a disc if ``planar``), and the goals.

    On a ring the places before jitter are evenly spaced. In an antipodal swap the goal is the point opposite
    to the place before jitter. The result depends on ``scenario``, ``seed`` and ``planar`` alone.
    """
    config, count = scenario.starts, scenario.vehicles
    slots, goals = places(scenario)
    jitter = np.full(scenario.size, config.jitter)
    if scenario.bystanders:
        jitter[count:] = [other.jitter for other in scenario.bystanders]
    random = stream(seed, Stream.STARTS)
    direction = random.normal(size=(scenario.size, 3))
    if planar:
        direction[:, 2] = 0.0
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    radius = jitter[:, None] * np.cbrt(random.uniform(size=(scenario.size, 1)))
    return Starts(slots + direction * radius, goals)


def places(scenario: Scenario) -> tuple[Array, Array | None]:
    """Return the starts (K, 3) before jitter, bystanders last, and the goals (vehicles, 3) or None, m."""
    slots, goals = _slots(scenario)
    if scenario.bystanders:
        slots = np.vstack([slots, [other.at for other in scenario.bystanders]])
    return slots, goals


def _slots(scenario: Scenario) -> tuple[Array, Array | None]:
    """Return the places and the goals of the vehicles with the task."""
    config = scenario.starts
    if isinstance(config, Points):
        return np.array(config.at), None if config.goals is None else np.array(config.goals)
    slots = _on_ring(config, scenario.vehicles)
    if scenario.task != "antipodal":
        return slots, None
    goals = slots.copy()
    goals[:, :2] = 2.0 * np.array(config.centre) - slots[:, :2]
    return slots, goals


def _on_ring(ring: Ring, count: int) -> Array:
    radius = ring.radius_of(count)
    angles = math.radians(ring.first_deg) + 2.0 * math.pi * np.arange(count) / count
    return np.column_stack(
        [
            ring.centre[0] + radius * np.cos(angles),
            ring.centre[1] + radius * np.sin(angles),
            np.full(count, ring.height),
        ]
    )
