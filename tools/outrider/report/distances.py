"""Distances between vehicles, to the target and to obstacles."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from companion.obstacles.moving import MovingObstacles
from outrider.report.run import Array, Motions
from outrider.runs.surfaces import Surfaces
from outrider.scenarios.scenario import Scenario

_MIN_HEIGHT = 0.2
"""Height (m) below which a vehicle may stand on the ground: there, only distances between vehicles count."""
_MERGE_S = 0.1
"""Time (s) around an encounter that counts as part of it."""


class Encounter(NamedTuple):
    """Violation of a distance limit from ``begin`` to ``end`` (s after the goal event).

    ``least`` (m) is the smallest distance, at ``time``; ``limit`` (m) is the violated limit. ``who``: the
    vehicle's system id, then the other vehicle's system id, or "the target" or "an obstacle".
    """

    begin: float
    end: float
    time: float
    least: float
    limit: float
    who: tuple[int, int | str]


def to_target(motions: Motions) -> Array:
    """Return the distance of each vehicle to the target (T, K), m."""
    result: Array = np.linalg.norm(motions.position - motions.target[:, None], axis=-1)
    return result


def to_obstacles(motions: Motions, scenario: Scenario) -> Array:
    """Return the distance of each vehicle's centre to the nearest obstacle surface (T, K), m.

    It is infinite without obstacles.
    """
    moving = MovingObstacles(scenario.moving_known)
    found = Surfaces(scenario.obstacles).nearest(motions.position)
    if len(moving) and motions.moving.shape[1] == len(moving):
        found = np.fmin(found, np.fmin.reduce(moving.distance(motions.position, motions.moving), axis=-1))
    return found


def encounters(motions: Motions, d_min: float, scenario: Scenario | None) -> list[Encounter]:
    """Return all violations in order of time: vehicles closer than ``d_min`` (m), and the scenario's limits.

    For pairs of vehicles only samples with a finite separation count: samples at which at least two vehicles
    were in the air.
    """
    flies = np.isfinite(motions.separation)
    found = []
    for (j, one), (k, other) in combinations(enumerate(motions.system), 2):
        apart = np.linalg.norm(motions.position[:, j] - motions.position[:, k], axis=-1)
        # Samples are 20 ms apart: smaller distances in between are only in ``separation``.
        found += _below(motions.time, np.where(flies, apart, np.inf), d_min, (one, other))
    for index in np.flatnonzero(motions.separation < d_min).tolist():
        time = float(motions.time[index])
        if not any(one.begin - _MERGE_S <= time <= one.end + _MERGE_S for one in found):
            least = float(motions.separation[index])
            found.append(Encounter(time, time, time, least, d_min, _nearest(motions, index)))
    if scenario is not None:
        found += _others(motions, scenario)
    return sorted(found, key=lambda one: (one.begin, str(one.who)))


def _others(motions: Motions, scenario: Scenario) -> list[Encounter]:
    found = []
    limit, surface = scenario.d_min_target, scenario.d_min_obstacle
    near_target, near_obstacle = to_target(motions), to_obstacles(motions, scenario)
    for k, system in enumerate(motions.system):
        aloft = motions.position[:, k, 2] > _MIN_HEIGHT
        if limit is not None:
            apart = np.where(aloft, near_target[:, k], np.inf)
            found += _below(motions.time, apart, limit, (system, "the target"))
        apart = np.where(aloft, near_obstacle[:, k], np.inf)
        found += _below(motions.time, apart, surface, (system, "an obstacle"))
    return found


def _below(time: Array, distance: Array, limit: float, who: tuple[int, int | str]) -> list[Encounter]:
    below = np.concatenate([[False], distance < limit, [False]])
    edges = np.flatnonzero(below[1:] != below[:-1])
    found = []
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        at = begin + int(np.argmin(distance[begin:end]))
        least = float(distance[at])
        found.append(Encounter(float(time[begin]), float(time[end - 1]), float(time[at]), least, limit, who))
    return found


def _nearest(motions: Motions, index: int) -> tuple[int, int]:
    """Return the two vehicles that are closest to each other at a sample."""
    place = motions.position[index]
    pairs = list(combinations(range(len(place)), 2))
    apart = [float(np.linalg.norm(place[j] - place[k])) for j, k in pairs]
    j, k = pairs[int(np.argmin(apart))]
    return motions.system[j], motions.system[k]
