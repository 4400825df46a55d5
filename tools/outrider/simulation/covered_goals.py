"""Goals that nobody can reach, because a vehicle whose companion has ended for good rests there.

The others keep the least distance between plans from the place where its last plan ends, for ever. A goal
nearer to that place than this distance is covered. As plans are known to the companions alone, the mean true
position in the first second at rest after the end of the companion stands for that place, and it stays: a
gust or a wrong fix moves the vehicle, but not the end of its plan. Where a vehicle should rest whose goal is
covered is the free place nearest to it: at the height of the goal, the least distance away from the vehicles
that rest for good and from the goals of the others, and clear of fixed obstacles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.certified.margins import between, from_surfaces
from companion.config.obstacles import Post
from companion.obstacles.static import FixedObstacles
from outrider.runs.ground_truth import Array
from outrider.scenarios.companion_settings import settings_of
from outrider.scenarios.faults import Vanish
from outrider.scenarios.scenario import Scenario

_AT_REST = 0.3
"""m/s."""
_REST_US = 1_000_000
_STEP_M = 0.05
_BEARINGS = np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False)
_FURTHEST = 4.0
"""Largest distance of a free place from its goal that is searched, in least distances."""


class CoveredGoals:
    """Goals (vehicles, 3), m, of a ``scenario`` that vehicles may cover whose companions end for good.

    ``near`` (m): distance from its place within which a vehicle has arrived. ``lasting`` (vehicles,): whether
    a vehicle's companion does not end for good.
    """

    def __init__(self, scenario: Scenario, goals: Array | None, near: float) -> None:
        ends = [fault for fault in scenario.faults if isinstance(fault, Vanish)]
        systems = scenario.systems[: scenario.vehicles]
        self.lasting = np.array([system not in {fault.vehicle for fault in ends} for system in systems])
        config = settings_of(scenario)
        self._goals = goals if config.avoidance == "certified" else None
        self._ends = {systems.index(end.vehicle): 1e6 * end.at_s for end in ends if end.vehicle in systems}
        self._least, self._near = between(config.certified, config.field, config.limits), near
        self._from_surfaces = from_surfaces(config.certified, config.field, config.limits)
        # Plans pass posts as if these had no top.
        self._fixed = FixedObstacles(
            [
                one.model_copy(update={"height": np.inf}) if isinstance(one, Post) else one
                for one in config.obstacles
            ]
        )
        self._seen: dict[int, tuple[int, Array, int]] = {}
        self._places: dict[int, Array] = {}
        self.covered: NDArray[np.bool_] = np.zeros(len(self.lasting), dtype=np.bool_)
        """Which goals are covered, (vehicles,)."""
        self.away: Array = np.zeros(len(self.lasting))
        """Distance (m) from each goal to the nearest free place, (vehicles,); 0: the goal is free."""

    def see(self, since: int, positions: Array, velocities: Array) -> None:
        """Update from the true ``positions`` and ``velocities`` (K, 3), m and m/s, of all vehicles.

        ``since`` (µs) is the time from the goal event.
        """
        if self._goals is None:
            return
        for index in self._ends.keys() - self._places.keys():
            if since < self._ends[index] or float(np.linalg.norm(velocities[index])) >= _AT_REST:
                self._seen.pop(index, None)
                continue
            began, total, count = self._seen.get(index, (since, np.zeros(3), 0))
            self._seen[index] = began, total + positions[index], count + 1
            if since - began >= _REST_US:
                self._places[index] = (total + positions[index]) / (count + 1)
                self._judge(self._goals)

    def _judge(self, goals: Array) -> None:
        """Find which of the ``goals`` (vehicles, 3), m, are covered, and the free places by them."""
        places = np.array(list(self._places.values()))
        apart = np.linalg.norm((goals[:, None] - places)[..., :2], axis=-1).min(axis=1)
        self.covered = (apart < self._least - self._near) & self.lasting
        for index in np.flatnonzero((apart < self._least) & self.lasting):
            others = goals[[k for k in range(len(goals)) if k != index and k not in self._ends]]
            taken = np.concatenate([places, others])[:, :2]
            self.away[index] = self._free(goals[index], taken)

    def _free(self, goal: Array, taken: Array) -> float:
        """Return how far (m) from ``goal`` (3,) the nearest free place is; 0 without one.

        ``taken`` (M, 2), m: places from which the least distance is kept.
        """
        for distance in np.arange(0.0, _FURTHEST * self._least, _STEP_M):
            ring = goal[:2] + distance * np.stack([np.cos(_BEARINGS), np.sin(_BEARINGS)], axis=1)
            free = (np.linalg.norm(ring[:, None] - taken, axis=-1) >= self._least).all(axis=1)
            places = np.column_stack([ring, np.full(len(ring), goal[2])])
            free &= (self._fixed.distance(places) >= self._from_surfaces).all(axis=1)
            if free.any():
                return float(distance)
        return 0.0
