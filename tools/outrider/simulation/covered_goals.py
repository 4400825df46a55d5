"""Goals that nobody can reach, because a vehicle whose companion has ended for good rests there.

The others keep the least distance between plans from the place where its last plan ends, for ever. A goal
nearer to that place than this distance is covered; as plans are only known to the companions, the true
position of the vehicle at rest stands for that place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.certified.margins import between
from outrider.runs.ground_truth import Array
from outrider.scenarios.companion_settings import settings_of
from outrider.scenarios.faults import Vanish
from outrider.scenarios.scenario import Scenario

_AT_REST = 0.3
"""m/s."""


class CoveredGoals:
    """Goals (vehicles, 3), m, of a ``scenario`` that vehicles may cover whose companions end for good.

    ``near`` (m): distance from its goal within which a vehicle has arrived. ``lasting`` (vehicles,): whether
    a vehicle's companion does not end for good.
    """

    def __init__(self, scenario: Scenario, goals: Array | None, near: float) -> None:
        ends = [fault for fault in scenario.faults if isinstance(fault, Vanish)]
        systems = scenario.systems[: scenario.vehicles]
        self.lasting = np.array([system not in {fault.vehicle for fault in ends} for system in systems])
        self._goals = goals
        self._ends = {systems.index(end.vehicle): 1e6 * end.at_s for end in ends if end.vehicle in systems}
        config = settings_of(scenario)
        self._least = between(config.certified, config.field, config.limits) - near
        if config.avoidance != "certified":
            self._goals = None

    def covered(self, since: int, positions: Array, velocities: Array) -> NDArray[np.bool_]:
        """Return which goals are covered ``since`` µs after the goal event, (vehicles,).

        ``positions`` and ``velocities`` (K, 3): true ones of all vehicles, m and m/s.
        """
        found = np.zeros(len(self.lasting), dtype=np.bool_)
        if self._goals is None:
            return found
        for index, end in self._ends.items():
            if since >= end and float(np.linalg.norm(velocities[index])) < _AT_REST:
                found |= np.linalg.norm(self._goals - positions[index], axis=1) < self._least
        result: NDArray[np.bool_] = found & self.lasting
        return result
